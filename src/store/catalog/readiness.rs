//! Whether the catalog can be read and written.

use super::dialect::{Connection, QUICK_CHECK, SIZE};
use super::{Catalog, now_ms};
use crate::error::Result;

/// Larger catalogs are not looked through, bytes: some 8 MB and 15 ms are 10 000 instances.
const CHECKED: i64 = 256 << 20;

/// What the database finds wrong with its own pages, if it is small enough to be looked through.
pub(super) async fn damage(connection: &mut Connection) -> Result<Option<String>, sqlx::Error> {
    let size: i64 = sqlx::query_scalar(SIZE).fetch_one(&mut *connection).await?;
    if size > CHECKED {
        return Ok(None);
    }
    let found: String = sqlx::query_scalar(QUICK_CHECK).fetch_one(connection).await?;
    Ok((found != "ok").then_some(found))
}

impl Catalog {
    /// What the database finds wrong with its own pages.
    pub(crate) async fn damage(&self) -> Result<Option<String>> {
        let mut connection = self.readers.acquire().await?;
        Ok(damage(&mut connection).await?)
    }

    /// Reads a row.
    pub(crate) async fn ping(&self) -> Result<()> {
        sqlx::query("SELECT 1").execute(&self.readers).await?;
        Ok(())
    }

    /// Writes a row, durably.
    pub(crate) async fn try_write(&self) -> Result<()> {
        let mut tx = self.begin().await?;
        sqlx::query(
            "INSERT INTO readiness (id, written_ms) VALUES (1, $1) \
             ON CONFLICT (id) DO UPDATE SET written_ms = excluded.written_ms",
        )
        .bind(now_ms())
        .execute(&mut *tx)
        .await?;
        Ok(tx.commit().await?)
    }
}
