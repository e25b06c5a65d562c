//! Makes an instance durable, groups it into its series, notices that a series is complete.
//!
//! The way of an instance: `Intake::begin` gives a spool file in `data_dir/incoming`; the bytes
//! are appended to it as they arrive; `Intake::store` runs the bounded scan over it, syncs it,
//! moves it to its place among the blobs, syncs the folder and enters it in the catalog, all
//! before it returns. Only then may anybody acknowledge it.

mod spool;

use std::sync::Arc;

use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;
use uuid::Uuid;

use crate::config::Config;
use crate::dicom::header::InstanceHeader;
use crate::dicom::uid::{SeriesInstanceUid, SopClassUid, SopInstanceUid};
use crate::error::Result;
use crate::store::{CompleteReason, ReconstructionId, Store};
use crate::telemetry::Metrics;

pub use crate::dicom::scan::Encoding;
pub use spool::Spool;

/// Who sent an instance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Sender {
    /// An association, by an id of ours, with its calling AE title.
    Association {
        /// Ours, for `Intake::association_ended`.
        id: Uuid,
        /// The calling AE title.
        calling_ae_title: String,
    },
    /// An HTTP request, by an id of ours; `Intake::upload_ended` ends it.
    Upload {
        /// Ours.
        id: Uuid,
    },
}

/// What the sender said of the instance before its bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Announced {
    /// How to read the bytes.
    pub encoding: Encoding,
    /// Affected SOP Class UID of the command, if there was one.
    pub sop_class_uid: Option<SopClassUid>,
    /// Affected SOP Instance UID of the command, if there was one.
    pub sop_instance_uid: Option<SopInstanceUid>,
    /// Who.
    pub sender: Sender,
}

/// The instance is durable.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Receipt {
    /// What its header says.
    pub header: InstanceHeader,
    /// It was stored before, with the same content.
    pub duplicate: bool,
}

/// The one way in. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Intake {}

#[expect(unused_variables, clippy::unused_async, reason = "the bodies follow")]
impl Intake {
    /// `wake` is told whenever a reconstruction was queued.
    #[must_use]
    pub fn new(store: Store, config: &Config, metrics: Arc<Metrics>, wake: Arc<Notify>) -> Self {
        todo!()
    }

    /// From now on [`Intake::begin`] refuses with `ShuttingDown`; what has begun may end.
    pub fn shut(&self) {
        todo!()
    }

    /// Room for one instance.
    ///
    /// # Errors
    /// Before any byte: the disk is below its watermark, the service is shutting down.
    pub async fn begin(&self) -> Result<Spool> {
        todo!()
    }

    /// Makes the instance durable: when this returns `Ok`, its bytes, its directory entry and its
    /// catalog row survive a power cut. It was counted and logged here, whatever the outcome.
    ///
    /// # Errors
    /// Every refusal of an instance in [`crate::error::Error`]; nothing is kept then.
    pub async fn store(&self, spool: Spool, announced: Announced) -> Result<Receipt> {
        todo!()
    }

    /// The sender will send nothing more: its series are complete after the short quiet time,
    /// unless others still send them.
    pub async fn association_ended(&self, sender: Uuid) -> Result<()> {
        todo!()
    }

    /// The upload was received whole. Completes its series (those of which an expected number is
    /// known and not reached are left to wait) and returns all of them.
    pub async fn upload_ended(&self, sender: Uuid) -> Result<Vec<SeriesInstanceUid>> {
        todo!()
    }

    /// Completes a series now. Returns its reconstruction with the configured parameters; `None`
    /// if it can't be reconstructed. One that is complete already is left as it is.
    ///
    /// # Errors
    /// No such series; a full queue.
    pub async fn complete(
        &self,
        series: &SeriesInstanceUid,
        reason: CompleteReason,
    ) -> Result<Option<ReconstructionId>> {
        todo!()
    }

    /// So many instances make the series whole; may be said before its first instance.
    pub async fn expect(&self, series: &SeriesInstanceUid, instances: u64) -> Result<()> {
        todo!()
    }

    /// Completes series whose quiet time has passed, until `shutdown`. The deadlines are rows:
    /// those of a former process fire too.
    pub async fn run_timers(&self, shutdown: CancellationToken) {
        todo!()
    }
}
