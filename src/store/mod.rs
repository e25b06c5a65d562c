//! What survives: the catalog (SQL) and the blobs (files).
//!
//! A [`Store`] is one data directory. The order of every change is: blobs durable first, then the
//! row that names them; on removal the row first, with a note of its blobs, then the blobs. So a row
//! never names a blob that isn't there, and what a crash leaves over is a blob without a row, which
//! the next start enters or sets aside, or one that is noted, which it removes.
//!
//! | file | what |
//! |---|---|
//! | `records`, `queue` | what the rest of the service sees |
//! | `open.rs` | locking, migration |
//! | `recovery/` | blobs without a row; a new catalog from the blobs |
//! | `source.rs` | the instances of a series as they are read, each held against its row |
//! | `check.rs` | `triplanar check` |
//! | `room.rs` | free space, readiness |
//! | `verify.rs` | whether a blob is what was acknowledged |
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
mod check;
mod hashed;
mod open;
mod queue;
mod reading;
mod receiving;
mod records;
mod recovery;
mod removing;
mod room;
mod source;
mod stored;
#[cfg(test)]
mod tests;
mod verify;
mod working;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64};

use tokio::sync::Mutex;

use crate::config;
use crate::error::{Error, Result};

use blobs::{Aside, Blobs};
use catalog::Catalog;

pub(crate) use catalog::{
    Added, Completion, End, NewInstance, OpenSender, Policy, SenderEnded, Settled, now_ms,
};
pub use check::{Checked, Problem};
pub(crate) use hashed::Damage;
pub use hashed::HashedFile;
pub use open::OpenError;
pub use queue::{Claim, Fault, Heartbeat, Lease, Outcome, Reclaim};
pub(crate) use receiving::Staged;
pub use records::{
    AttributeChange, BrokenTransfer, Clinical, ClinicalChoice, CompleteReason, IdentityChange,
    InstanceRecord, Page, ReconstructionFilter, ReconstructionId, ReconstructionRecord, ReconstructionState,
    Refused, SenderEnd, SeriesFilter, SeriesRecord, SeriesState, TransferDoubt, UnreadableRow,
};
pub use recovery::{MissingInstances, Rebuilt, Recovered, SetAside};
pub use removing::Swept;
pub use room::Readiness;
pub use source::{LostInstances, StoredInstances};
pub(crate) use stored::report_json;

/// Catalog and blobs of one data directory. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Store(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    catalog: Catalog,
    blobs: Arc<dyn Blobs>,
    incoming: PathBuf,
    aside: Aside,
    settings: config::Storage,
    readiness: Mutex<room::Last>,
    /// The catalog was found damaged when it was looked at last.
    damaged: AtomicBool,
    counts: Counts,
    /// Held as long as the store is.
    lock: open::Locks,
}

/// What was found wrong and dealt with, for the metrics.
#[derive(Debug, Default)]
pub(crate) struct Counts {
    /// Blobs without a row that got theirs.
    pub(crate) entered: AtomicU64,
    /// Blobs that were not what was acknowledged, replaced by a duplicate.
    pub(crate) replaced: AtomicU64,
    /// Files in `set-aside/`.
    pub(crate) set_aside_files: AtomicU64,
    /// Their bytes.
    pub(crate) set_aside_bytes: AtomicU64,
}

impl Store {
    /// What was found wrong and dealt with.
    pub(crate) fn counts(&self) -> &Counts {
        &self.0.counts
    }

    /// Ends the connections to the catalog and gives the data directory free, although clones of
    /// this store may still exist: every further call of them fails.
    pub async fn close(&self) {
        self.0.catalog.close().await;
        if let Err(error) = self.0.lock.release() {
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
