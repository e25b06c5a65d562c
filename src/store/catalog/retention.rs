//! Removal of what is older than configured: rows first; their blobs are rubbish from then on.

use super::Catalog;
use super::removed::{self, Removed};
use crate::error::Result;

impl Catalog {
    /// Removes final reconstructions that ended before `before_ms`.
    pub(crate) async fn remove_old_reconstructions(&self, before_ms: i64) -> Result<(u64, Removed)> {
        let mut tx = self.begin().await?;
        let gone: Vec<Option<String>> = sqlx::query_scalar(
            "DELETE FROM reconstructions WHERE finished_ms < $1 AND state NOT IN ('queued', 'running') \
             RETURNING result",
        )
        .bind(before_ms)
        .fetch_all(&mut *tx)
        .await?;
        sqlx::query(
            "UPDATE reconstructions SET superseded_by = NULL WHERE superseded_by IS NOT NULL \
             AND superseded_by NOT IN (SELECT id FROM reconstructions)",
        )
        .execute(&mut *tx)
        .await?;
        let removed = Removed { blobs: Vec::new(), results: gone.iter().flatten().cloned().collect() };
        removed::note(&mut tx, &removed).await?;
        tx.commit().await?;
        Ok((gone.len() as u64, removed))
    }

    /// Removes the instances of series that were complete and untouched since `before_ms`, unless
    /// a job needs them; and what is known of series of which nothing was ever stored.
    pub(crate) async fn remove_old_instances(&self, before_ms: i64) -> Result<(u64, Removed)> {
        let mut tx = self.begin().await?;
        let old: Vec<String> = sqlx::query_scalar(
            "SELECT series_uid FROM series s WHERE state <> 'receiving' AND updated_ms < $1 AND instances > 0 \
             AND NOT EXISTS (SELECT 1 FROM reconstructions r WHERE r.series_uid = s.series_uid \
                             AND r.state IN ('queued', 'running'))",
        )
        .bind(before_ms)
        .fetch_all(&mut *tx)
        .await?;
        let mut removed = Removed::default();
        for uid in &old {
            let blobs: Vec<String> =
                sqlx::query_scalar("DELETE FROM instances WHERE series_uid = $1 RETURNING blob")
                    .bind(uid)
                    .fetch_all(&mut *tx)
                    .await?;
            removed.blobs.extend(blobs);
            sqlx::query("UPDATE series SET instances = 0, bytes = 0 WHERE series_uid = $1")
                .bind(uid)
                .execute(&mut *tx)
                .await?;
        }
        for statement in [
            "DELETE FROM expectations WHERE set_ms < $1 AND series_uid NOT IN (SELECT series_uid FROM series)",
            "DELETE FROM refused WHERE last_ms < $1 AND series_uid NOT IN (SELECT series_uid FROM series)",
        ] {
            sqlx::query(statement).bind(before_ms).execute(&mut *tx).await?;
        }
        removed::note(&mut tx, &removed).await?;
        tx.commit().await?;
        Ok((old.len() as u64, removed))
    }

    /// Removes series of which neither instances nor reconstructions are left.
    pub(crate) async fn remove_empty_series(&self) -> Result<()> {
        let mut tx = self.begin().await?;
        sqlx::query(
            "DELETE FROM series WHERE instances = 0 \
             AND NOT EXISTS (SELECT 1 FROM reconstructions r WHERE r.series_uid = series.series_uid)",
        )
        .execute(&mut *tx)
        .await?;
        Ok(tx.commit().await?)
    }
}
