//! Blobs whose rows are gone and that must follow them. They are noted in the transaction that
//! removes the rows: a blob without a row is kept at the next start, unless it is noted here.

use super::Catalog;
use super::dialect::Connection;
use crate::error::Result;

/// Blobs that no row names any more.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub(crate) struct Removed {
    /// Keys.
    pub(crate) blobs: Vec<String>,
    /// Prefixes of results.
    pub(crate) results: Vec<String>,
}

impl Removed {
    /// Keys and prefixes.
    pub(crate) fn all(&self) -> impl Iterator<Item = &String> {
        self.blobs.iter().chain(&self.results)
    }
}

/// Notes blobs within the transaction that takes their rows.
pub(super) async fn note(connection: &mut Connection, removed: &Removed) -> Result<()> {
    for blob in removed.all() {
        sqlx::query("INSERT INTO removed_blobs (blob) VALUES ($1) ON CONFLICT (blob) DO NOTHING")
            .bind(blob)
            .execute(&mut *connection)
            .await?;
    }
    Ok(())
}

impl Catalog {
    /// What was noted and is not known to be gone.
    pub(crate) async fn removed_blobs(&self) -> Result<Removed> {
        let noted: Vec<String> =
            sqlx::query_scalar("SELECT blob FROM removed_blobs").fetch_all(&self.readers).await?;
        let (results, blobs) = noted.into_iter().partition(|blob| blob.starts_with("results/"));
        Ok(Removed { blobs, results })
    }

    /// They are gone.
    pub(crate) async fn forget_removed(&self, removed: &Removed) -> Result<()> {
        if removed.all().next().is_none() {
            return Ok(());
        }
        let mut tx = self.begin().await?;
        for blob in removed.all() {
            sqlx::query("DELETE FROM removed_blobs WHERE blob = $1").bind(blob).execute(&mut *tx).await?;
        }
        Ok(tx.commit().await?)
    }
}
