//! Makes an instance durable, groups it into its series, notices that a series is complete.
//!
//! The way of an instance: [`Intake::begin`] gives a [`Spool`], the bytes are appended to it as they
//! arrive; [`Intake::store`] runs the bounded scan over them, writes our file header and the
//! untouched data set to a file, syncs it, moves it to its place among the blobs, syncs the folder
//! and enters it in the catalog, all before it returns. Only then may anybody acknowledge it.
//!
//! | file | what |
//! |---|---|
//! | `spool` | bytes as they arrive, within the limit |
//! | `examination` | the scan, and whether the data set is what was announced |
//! | `receipt` | durable, with a row: or a reason why not |
//! | `correction` | an instance that came again with another identity |
//! | `duplicate` | an instance whose UID is stored already |
//! | `senders` | in which order senders began and broke off, and what lacks of them |
//! | `completeness` | when a series is complete |

mod completeness;
mod correction;
mod duplicate;
mod examination;
mod receipt;
mod senders;
mod spool;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use tokio::sync::{Notify, Semaphore};
use uuid::Uuid;

use crate::config::{ChangedIdentity, Config};
use crate::dicom::header::InstanceHeader;
use crate::dicom::scan::Limits;
use crate::dicom::series;
use crate::dicom::uid::{SopClassUid, SopInstanceUid, StudyInstanceUid};
use crate::error::{Error, Result};
use crate::memory::Memory;
use crate::store::{OpenSender, Policy, Store};
use crate::telemetry::{Metrics, SenderKind};

pub use crate::dicom::scan::Encoding;
pub(crate) use spool::Beginning;
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
    /// The study that the request stores to, if it names one (PS3.18 section 10.5).
    pub study_instance_uid: Option<StudyInstanceUid>,
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

impl Sender {
    /// Our id of the association or upload.
    #[must_use]
    pub fn id(&self) -> Uuid {
        match self {
            Self::Association { id, .. } | Self::Upload { id } => *id,
        }
    }

    fn kind(&self) -> SenderKind {
        match self {
            Self::Association { .. } => SenderKind::Association,
            Self::Upload { .. } => SenderKind::Upload,
        }
    }
}

/// The one way in. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Intake {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    store: Store,
    metrics: Arc<Metrics>,
    /// Told that a reconstruction was queued.
    wake: Arc<Notify>,
    /// Told that a deadline may have come nearer.
    timers: Notify,
    shut: AtomicBool,
    comparisons: Semaphore,
    memory: Memory,
    senders: senders::Senders,
    policy: Policy,
    scan_limits: Limits,
    max_instance_bytes: u64,
    changed_identity: ChangedIdentity,
}

impl Intake {
    /// `wake` is told whenever a reconstruction was queued; what instances are compared in comes from
    /// `memory`.
    #[must_use]
    pub fn new(
        store: Store,
        config: &Config,
        metrics: Arc<Metrics>,
        wake: Arc<Notify>,
        memory: Memory,
    ) -> Self {
        let policy = Policy {
            max_series_instances: config.intake.max_series_instances,
            quiet_ms: milliseconds(config.intake.quiet),
            quiet_after_association_ms: milliseconds(config.intake.quiet_after_association),
            parameters: config.pipeline.clone(),
            max_queued: config.jobs.max_queued,
            min_slices: config.intake.min_slices,
            unfit: series::unfit,
        };
        let shared = Shared {
            store,
            metrics,
            wake,
            timers: Notify::new(),
            shut: AtomicBool::new(false),
            comparisons: Semaphore::new(1),
            memory,
            senders: senders::Senders::default(),
            policy,
            scan_limits: Limits { max_inflated_bytes: config.intake.max_inflated_bytes, ..Limits::default() },
            max_instance_bytes: config.intake.max_instance_bytes,
            changed_identity: config.intake.changed_identity,
        };
        Self { shared: Arc::new(shared) }
    }

    /// The settings by which series are collected.
    #[cfg(test)]
    pub(crate) fn policy(&self) -> &Policy {
        &self.shared.policy
    }

    /// From now on [`Intake::begin`] refuses with `ShuttingDown`; what has begun may end.
    pub fn shut(&self) {
        self.shared.shut.store(true, Ordering::Relaxed);
    }

    /// Room for one instance.
    ///
    /// # Errors
    /// Before any byte: the disk is below its watermark, the catalog is damaged, the service is shutting down.
    pub async fn begin(&self) -> Result<Spool> {
        if self.shared.shut.load(Ordering::Relaxed) {
            return Err(Error::ShuttingDown);
        }
        self.shared.store.check_catalog()?;
        if !self.shared.store.has_room()? {
            return Err(Error::OutOfStorage);
        }
        Ok(Spool::new(self.shared.store.clone(), self.shared.max_instance_bytes))
    }

    /// The sender begins. One that sends an instance before this was said began with that.
    pub fn sender_begins(&self, sender: Uuid) {
        self.shared.senders.begun(sender);
    }

    /// The sender breaks off now; [`Intake::sender_ended`] must follow.
    pub fn sender_breaks(&self, sender: Uuid) {
        self.shared.senders.breaks(sender);
    }

    /// An instance of the sender lacks, and no series is known to be its own: all that the sender sent
    /// is in doubt when it has ended. `None`: not even its UID is known.
    pub fn lacks(&self, sender: Uuid, instance: Option<SopInstanceUid>) {
        self.shared.senders.lacks(sender, instance);
    }

    fn open_sender(&self, sender: &Sender) -> OpenSender {
        let id = sender.id();
        let is_upload = matches!(sender, Sender::Upload { .. });
        OpenSender { id, begun: self.shared.senders.begun(id), is_upload }
    }

    /// The sender ended within an instance: nothing of it is kept. What it sent of a series before is in
    /// doubt, and so is the instance's own series, where what came of it tells that.
    pub(crate) fn cut(
        &self,
        sender: &Sender,
        announced: Option<&str>,
        begun: Option<(&Beginning, &Encoding)>,
    ) {
        let kind = sender.kind();
        let told = begun.and_then(|(bytes, encoding)| bytes.identity(encoding, &self.shared.scan_limits));
        let announced: Option<SopInstanceUid> = announced.and_then(|uid| uid.parse().ok());
        let (series, instance) = match (told, announced) {
            (Some((series, told)), announced) => (Some(series), Some(announced.unwrap_or(told))),
            (None, announced) => (None, announced),
        };
        if let Some(instance) = instance.clone() {
            self.shared.senders.cut(sender.id(), instance, series.clone());
        }
        self.shared.metrics.instance_received(kind, "cut");
        let id = sender.id();
        let instance = instance.as_ref().map_or("not told", |uid| uid.as_str());
        let series = series.as_ref().map_or("not told", |uid| uid.as_str());
        tracing::warn!(
            sender = kind.name(),
            %id,
            series,
            sop_instance_uid = instance,
            "the sender ended within an instance; it was not stored"
        );
    }

    /// Makes the instance durable: when this returns `Ok`, its bytes, its directory entry and its
    /// catalog row survive a power cut. It was counted and logged here, whatever the outcome.
    ///
    /// # Errors
    /// Every refusal of an instance in [`Error`]; nothing is kept then.
    pub async fn store(&self, spool: Spool, announced: Announced) -> Result<Receipt> {
        let kind = announced.sender.kind();
        let intake = self.clone();
        // A task of its own: it runs to its end even if the caller's connection is gone by then.
        let received = tokio::spawn(async move { intake.receive(spool, announced).await });
        let received = received.await.map_err(Error::internal).flatten();
        let outcome = match &received {
            Ok(Receipt { duplicate: true, .. }) => "duplicate",
            Ok(_) => "stored",
            Err(error) => error.mapping().code,
        };
        self.shared.metrics.instance_received(kind, outcome);
        match &received {
            Ok(Receipt { header, duplicate }) => {
                let (series, instance) = (&header.series_instance_uid, &header.sop_instance_uid);
                tracing::debug!(%series, %instance, duplicate, sender = kind.name(), "instance stored");
            }
            Err(Error::Internal(cause)) => {
                tracing::error!(%cause, sender = kind.name(), "an instance can't be stored");
            }
            Err(error) => {
                self.shared.store.note_damage(error);
                tracing::warn!(code = outcome, detail = %error, sender = kind.name(), "instance refused");
            }
        }
        received
    }
}

fn milliseconds(duration: Duration) -> i64 {
    i64::try_from(duration.as_millis()).unwrap_or(i64::MAX / 2)
}
