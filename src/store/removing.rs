//! Removal, asked for or by age. Rows go first, and leave a note of their blobs in the same
//! transaction; what is noted goes now, at the next sweep or at the next start.

use std::sync::Arc;

use super::catalog::Removed;
use super::{ReconstructionId, Store, blocking};
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::Result;

const DAY_MS: i64 = 86_400_000;

/// What [`Store::sweep`] removed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Swept {
    /// Series whose source instances were removed.
    pub series: u64,
    /// Reconstructions removed.
    pub reconstructions: u64,
}

impl Store {
    /// Removes a series with its instances and reconstructions; false if there is none. A worker
    /// that reconstructs it learns of it at its next heartbeat.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn delete_series(&self, uid: &SeriesInstanceUid) -> Result<bool> {
        let removed = self.0.catalog.delete_series(uid).await?;
        let existed = removed.is_some();
        self.remove_blobs(removed.unwrap_or_default()).await?;
        Ok(existed)
    }

    /// Removes a reconstruction with its results; false if there is none. A worker that runs it
    /// learns of it at its next heartbeat.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn delete_reconstruction(&self, id: ReconstructionId) -> Result<bool> {
        let removed = self.0.catalog.delete_reconstruction(id).await?;
        let existed = removed.is_some();
        self.remove_blobs(removed.unwrap_or_default()).await?;
        Ok(existed)
    }

    /// Removes what is older than the configured retention: reconstructions by the time they
    /// ended, source instances by the time the latest of their series came. A series whose sources
    /// are gone keeps its reconstructions; one with neither is removed.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn sweep(&self, now_ms: i64) -> Result<Swept> {
        self.remove_replaced(false).await?;
        let mut swept = Swept::default();
        let settings = &self.0.settings;
        if settings.result_retention_days > 0 {
            let before = now_ms - i64::from(settings.result_retention_days) * DAY_MS;
            let (count, removed) = self.0.catalog.remove_old_reconstructions(before).await?;
            swept.reconstructions = count;
            self.remove_blobs(removed).await?;
        }
        if settings.source_retention_days > 0 {
            let before = now_ms - i64::from(settings.source_retention_days) * DAY_MS;
            let (count, removed) = self.0.catalog.remove_old_instances(before).await?;
            swept.series = count;
            self.remove_blobs(removed).await?;
        }
        self.0.catalog.remove_empty_series().await?;
        self.remove_noted().await?;
        self.bound_set_aside().await?;
        Ok(swept)
    }

    /// Removes the blobs of data sets that were replaced by ones with a corrected identity, but for
    /// those that a running reconstruction may read. `at_start`: none runs.
    ///
    /// # Errors
    /// The catalog's own, the disk's.
    pub(crate) async fn remove_replaced(&self, at_start: bool) -> Result<()> {
        let replaced = self.0.catalog.replaced_blobs(at_start).await?;
        if replaced.is_empty() {
            return Ok(());
        }
        // The rows go last: a blob whose removal fails is tried again.
        self.remove_blobs(Removed { blobs: replaced.clone(), results: Vec::new() }).await?;
        self.0.catalog.forget_replaced(&replaced).await
    }

    /// Removes results that never had a row.
    pub(super) async fn remove_results(&self, results: Vec<String>) -> Result<()> {
        self.take_blobs(&Removed { blobs: Vec::new(), results }).await
    }

    /// Removes blobs whose rows were removed and that are still there.
    pub(super) async fn remove_noted(&self) -> Result<()> {
        let removed = self.0.catalog.removed_blobs().await?;
        self.remove_blobs(removed).await
    }

    /// Removes blobs that are noted, and then the notes.
    pub(super) async fn remove_blobs(&self, removed: Removed) -> Result<()> {
        self.take_blobs(&removed).await?;
        self.0.catalog.forget_removed(&removed).await
    }

    async fn take_blobs(&self, removed: &Removed) -> Result<()> {
        let (blobs, removed) = (Arc::clone(&self.0.blobs), removed.clone());
        blocking(move || {
            for key in &removed.blobs {
                blobs.remove(key)?;
            }
            for prefix in &removed.results {
                blobs.remove_all(prefix)?;
            }
            Ok(())
        })
        .await
    }
}
