//! What survives: the catalog (SQL) and the blobs (files).

mod queue;
mod records;

use std::io;
use std::time::Duration;

use crate::config;
use crate::dicom::source::InstanceSource;
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::Result;
use crate::geometry::Plane;
use crate::pipeline::{Parameters, Stage};

pub use queue::{Claim, Fault, Heartbeat, Lease, Outcome, Reclaim};
pub use records::{
    CompleteReason, InstanceRecord, Page, ReconstructionFilter, ReconstructionId, ReconstructionRecord,
    ReconstructionState, Refused, SeriesFilter, SeriesRecord, SeriesState, UnfitReason,
};

/// Whether what the store stands on answers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Readiness {
    /// The catalog; the error without any row's content.
    pub catalog: Result<(), String>,
    /// The data directory: writable, and above the watermark of free space.
    pub data_dir: Result<(), String>,
}

/// What [`Store::sweep`] removed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Swept {
    /// Series whose source instances were removed.
    pub series: u64,
    /// Reconstructions removed.
    pub reconstructions: u64,
}

/// The stored instances of a series as [`InstanceSource`].
#[derive(Debug, Clone)]
pub struct StoredInstances {}

impl InstanceSource for StoredInstances {
    fn len(&self) -> usize {
        todo!()
    }
    fn read(&self, _index: usize) -> io::Result<Vec<u8>> {
        todo!()
    }
}

/// Catalog and blobs of one data directory. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Store {}

#[expect(unused_variables, clippy::unused_async, reason = "the bodies follow")]
impl Store {
    /// Opens the data directory: makes it if it is missing, locks it against a second service,
    /// brings the catalog to this version's schema, removes what a crash left behind.
    ///
    /// # Errors
    /// A data directory that is locked, not writable, or of a newer version.
    pub async fn open(config: &config::Storage) -> Result<Self> {
        todo!()
    }

    /// One series.
    pub async fn series(&self, uid: &SeriesInstanceUid) -> Result<Option<SeriesRecord>> {
        todo!()
    }
    /// Series, newest first.
    pub async fn list_series(
        &self,
        filter: &SeriesFilter,
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<SeriesRecord>> {
        todo!()
    }
    /// All stored instances of a series, by SOP Instance UID.
    pub async fn instances(&self, uid: &SeriesInstanceUid) -> Result<Vec<InstanceRecord>> {
        todo!()
    }
    /// Exactly the instances that a reconstruction is made from (later ones left out).
    ///
    /// # Errors
    /// [`crate::error::Error::SourceRemoved`] if they are no longer stored.
    pub async fn instances_of(&self, reconstruction: &ReconstructionRecord) -> Result<Vec<InstanceRecord>> {
        todo!()
    }
    /// Instances of a series that were refused because others are stored under their UIDs.
    pub async fn refused(&self, uid: &SeriesInstanceUid) -> Result<Vec<Refused>> {
        todo!()
    }
    /// Removes a series with its instances and reconstructions; false if there is none.
    pub async fn delete_series(&self, uid: &SeriesInstanceUid) -> Result<bool> {
        todo!()
    }
    /// The bytes of `instances`, to be read by synchronous code.
    #[must_use]
    pub fn instance_source(&self, instances: &[InstanceRecord]) -> StoredInstances {
        todo!()
    }

    /// One reconstruction.
    pub async fn reconstruction(&self, id: ReconstructionId) -> Result<Option<ReconstructionRecord>> {
        todo!()
    }
    /// Reconstructions, newest first.
    pub async fn list_reconstructions(
        &self,
        filter: &ReconstructionFilter,
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<ReconstructionRecord>> {
        todo!()
    }
    /// The latest succeeded reconstruction of a series.
    pub async fn latest_succeeded(&self, uid: &SeriesInstanceUid) -> Result<Option<ReconstructionRecord>> {
        todo!()
    }
    /// The stored cloud (binary PLY, LPS) of one plane, or the triplanar one.
    pub async fn cloud(&self, id: ReconstructionId, plane: Option<Plane>) -> Result<Vec<u8>> {
        todo!()
    }
    /// The stored report (JSON).
    pub async fn report(&self, id: ReconstructionId) -> Result<Vec<u8>> {
        todo!()
    }
    /// Removes a reconstruction with its results; false if there is none. A worker that runs it
    /// learns of it at its next heartbeat.
    pub async fn delete_reconstruction(&self, id: ReconstructionId) -> Result<bool> {
        todo!()
    }

    /// Asks for a reconstruction of a complete series. The same instances and parameters again
    /// are the same reconstruction; one that failed or was cancelled is queued again under its id,
    /// with its attempts counted from zero. True if this call queued it.
    ///
    /// # Errors
    /// No such series, one that is not complete or can't be reconstructed, a full queue
    /// (`max_queued`), instances that were removed.
    pub async fn enqueue(
        &self,
        uid: &SeriesInstanceUid,
        parameters: &Parameters,
        max_queued: u64,
    ) -> Result<(ReconstructionRecord, bool)> {
        todo!()
    }
    /// Takes the reconstruction that waited longest and is due, and counts an attempt.
    pub async fn claim(&self, worker: &str, lease: Duration) -> Result<Option<Claim>> {
        todo!()
    }
    /// Records progress and renews the lease. `fraction` is of the whole, 0 to 1.
    pub async fn heartbeat(
        &self,
        lease: &Lease,
        stage: Stage,
        fraction: f64,
        renew_for: Duration,
    ) -> Result<Heartbeat> {
        todo!()
    }
    /// Stores the result, marks the reconstruction succeeded, and supersedes those of earlier
    /// revisions of the series with the same parameters. False: the lease was lost, nothing changed.
    pub async fn finish_success(&self, lease: &Lease, outcome: &Outcome) -> Result<bool> {
        todo!()
    }
    /// Marks it failed, with its report if there is one. False: the lease was lost.
    pub async fn finish_failure(&self, lease: &Lease, fault: &Fault, report: Option<&[u8]>) -> Result<bool> {
        todo!()
    }
    /// Marks it cancelled, as somebody asked. False: the lease was lost.
    pub async fn finish_cancelled(&self, lease: &Lease) -> Result<bool> {
        todo!()
    }
    /// Queues it again, not before that time; its last fault is kept on the row. The caller has
    /// checked that attempts are left. False: the lease was lost.
    pub async fn retry(&self, lease: &Lease, not_before_ms: i64, fault: &Fault) -> Result<bool> {
        todo!()
    }
    /// Gives it back as if it had not been claimed (shutting down). False: the lease was lost.
    pub async fn release(&self, lease: &Lease) -> Result<bool> {
        todo!()
    }
    /// Cancels: a queued one at once, a running one at its next heartbeat, a final one not at all
    /// (it is returned as it is).
    ///
    /// # Errors
    /// No such reconstruction.
    pub async fn cancel(&self, id: ReconstructionId) -> Result<ReconstructionRecord> {
        todo!()
    }
    /// Queues again what lost its worker; one without attempts left has failed with `worker_died`.
    /// Returns those that changed, as they are now.
    pub async fn reclaim(&self, which: Reclaim, max_attempts: u32) -> Result<Vec<ReconstructionRecord>> {
        todo!()
    }
    /// When the next queued reconstruction may be claimed, Unix ms; `None` if none is queued.
    pub async fn next_claim_ms(&self) -> Result<Option<i64>> {
        todo!()
    }
    /// How many reconstructions are queued.
    pub async fn queued(&self) -> Result<u64> {
        todo!()
    }

    /// Asks what the store stands on whether it answers.
    pub async fn ready(&self) -> Readiness {
        todo!()
    }
    /// Free bytes on the disk of the data directory.
    pub fn free_bytes(&self) -> Result<u64> {
        todo!()
    }
    /// Removes what is older than the configured retention.
    pub async fn sweep(&self, now_ms: i64) -> Result<Swept> {
        todo!()
    }
}
