//! What survives: the catalog (SQL) and the blobs (files).
//!
//! A [`Store`] is one data directory. The order of every change is: blobs durable first, then the
//! row that names them; on removal the row first, then the blobs. So a row never names a blob that
//! isn't there, and what a crash leaves over is a blob without a row, removed at the next start.
//!
//! | file | what |
//! |---|---|
//! | `records`, `queue` | what the rest of the service sees |
//! | `open.rs` | locking, migration, clean-up at start |
//! | `reading.rs` | series, instances and reconstructions as they are |
//! | `receiving.rs` | what only the intake does |
//! | `working.rs` | what only the job workers do |
//! | `removing.rs` | removal and retention |
//! | `stored/` | what rows and result files hold, by schema |
//! | `catalog/` | all SQL |
//! | `blobs/` | all files |
//! | `hashed/` | files of results with the hashes of their blocks |

mod blobs;
mod catalog;
mod hashed;
mod open;
mod queue;
mod reading;
mod receiving;
mod records;
mod removing;
mod stored;
mod working;

use std::fs::File;
use std::path::PathBuf;
use std::sync::Arc;

use crate::config;
use crate::error::{Error, Result};

use blobs::Blobs;
use catalog::Catalog;

pub(crate) use catalog::{Added, Completion, End, NewInstance, Policy, Settled, now_ms};
pub(crate) use hashed::Damage;
pub use hashed::HashedFile;
pub use open::OpenError;
pub use queue::{Claim, Fault, Heartbeat, Lease, Outcome, Reclaim};
pub use reading::StoredInstances;
pub(crate) use receiving::Staged;
pub use records::{
    Clinical, ClinicalChoice, CompleteReason, IdentityChange, IdentityField, InstanceRecord, Page,
    ReconstructionFilter, ReconstructionId, ReconstructionRecord, ReconstructionState, Refused, SenderEnd,
    SeriesFilter, SeriesRecord, SeriesState, TransferDoubt, UnfitReason, UnreadableRow,
};
pub use removing::Swept;
pub(crate) use stored::report_json;

/// Catalog and blobs of one data directory. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Store(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    catalog: Catalog,
    blobs: Arc<dyn Blobs>,
    incoming: PathBuf,
    settings: config::Storage,
    /// Held as long as the store is.
    lock: File,
}

/// Whether what the store stands on answers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Readiness {
    /// The catalog; the error without any row's content.
    pub catalog: Result<(), String>,
    /// The data directory: writable, and above the watermark of free space.
    pub data_dir: Result<(), String>,
}

impl Store {
    /// Asks what the store stands on whether it answers.
    pub async fn ready(&self) -> Readiness {
        let catalog = self.0.catalog.ping().await.map_err(|_| "the catalog does not answer".to_owned());
        let blobs = Arc::clone(&self.0.blobs);
        let written = blocking(move || Ok(blobs.temporary().map(drop)?)).await;
        let data_dir = match (written, self.has_room()) {
            (Err(_), _) => Err("the data directory can't be written".to_owned()),
            (Ok(()), Ok(true)) => Ok(()),
            (Ok(()), Ok(false)) => Err(Error::OutOfStorage.to_string()),
            (Ok(()), Err(_)) => Err("the data directory's free space can't be read".to_owned()),
        };
        Readiness { catalog, data_dir }
    }

    /// Free bytes on the disk of the data directory.
    ///
    /// # Errors
    /// The file system does not tell.
    pub fn free_bytes(&self) -> Result<u64> {
        let disk = rustix::fs::statvfs(&self.0.settings.data_dir).map_err(std::io::Error::from)?;
        Ok(disk.f_bavail.saturating_mul(disk.f_frsize))
    }

    /// Whether the free space is above the watermark.
    pub(crate) fn has_room(&self) -> Result<bool> {
        Ok(self.free_bytes()? >= self.0.settings.min_free_bytes)
    }

    /// Ends the connections to the catalog and gives the data directory free, although clones of
    /// this store may still exist: every further call of them fails.
    pub async fn close(&self) {
        self.0.catalog.close().await;
        if let Err(error) = self.0.lock.unlock() {
            tracing::warn!(%error, "the lock of the data directory can't be released");
        }
    }
}

/// Runs synchronous work on a thread where it may block.
pub(crate) async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T> + Send + 'static,
) -> Result<T> {
    tokio::task::spawn_blocking(work).await.map_err(Error::internal)?
}
