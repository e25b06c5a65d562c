//! The rows of the catalog as the rest of the service sees them. Times are Unix milliseconds, UTC.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use uuid::Uuid;

use crate::dicom::header::InstanceHeader;
use crate::dicom::identity::IdentityField;
use crate::dicom::series::UnfitReason;
use crate::dicom::uid::{FrameOfReferenceUid, SeriesInstanceUid, SopInstanceUid, StudyInstanceUid};
use crate::named::named;
use crate::observer::Stage;
use crate::pipeline::precise::Quality;
use crate::pipeline::{Figures, Parameters};

named! {
    /// Where a series stands.
    SeriesState {
        /// Instances are still expected.
        Receiving = "receiving",
        /// All are there; a reconstruction was made or is under way.
        Complete = "complete",
        /// Complete, kept, but no head CT: see [`UnfitReason`].
        NotReconstructable = "not_reconstructable",
    }
}

named! {
    /// What made a series complete.
    ///
    /// `explicit`: `POST /v1/series/{uid}/complete`. `expected_instances`: as many are there as were
    /// announced. `association_ended`: the association that sent it ended, and the short quiet time
    /// passed. `upload_ended`: the same of HTTP; a whole archive or form needs no quiet time. `quiet`:
    /// nothing came for the long quiet time.
    CompleteReason {
        /// `POST /v1/series/{uid}/complete`.
        Explicit = "explicit",
        /// The expected number of instances is there.
        ExpectedInstances = "expected_instances",
        /// The association that sent it ended (or whatever sent it, with a former process), and the
        /// short quiet time passed.
        AssociationEnded = "association_ended",
        /// The quiet time passed.
        Quiet = "quiet",
        /// The upload that brought it was whole; or the HTTP requests that brought it one by one ended
        /// and the short quiet time passed.
        UploadEnded = "upload_ended",
    }
}

named! {
    /// How a sender ended: an association, an upload, or an HTTP request that brought instances.
    SenderEnd {
        /// A-RELEASE.
        AssociationReleased = "association_released",
        /// A-ABORT, of the sender or of ours: a timeout, a protocol error.
        AssociationAborted = "association_aborted",
        /// The connection was lost or closed without a release.
        AssociationLost = "association_lost",
        /// The request's body was received whole.
        UploadEnded = "upload_ended",
        /// The body broke off, or what it held could not be read to its end.
        UploadBroken = "upload_broken",
        /// It ended well, but instances had been refused for want of room, or were so damaged that their
        /// series can't be told, and did not come again.
        InstancesRefused = "instances_refused",
        /// The service stopped, or was stopped, while it sent.
        ServiceStopped = "service_stopped",
    }
}

impl SenderEnd {
    /// What a series is complete for after the short quiet time; `None` if the sender did not end
    /// well: then only the long one counts.
    #[must_use]
    pub fn completes(self) -> Option<CompleteReason> {
        match self {
            Self::AssociationReleased => Some(CompleteReason::AssociationEnded),
            Self::UploadEnded => Some(CompleteReason::UploadEnded),
            Self::AssociationAborted
            | Self::AssociationLost
            | Self::UploadBroken
            | Self::InstancesRefused
            | Self::ServiceStopped => None,
        }
    }
}

named! {
    /// Why a series may not be what its sender meant to send, or what was made of it not what that shows.
    TransferDoubt {
        /// A sender broke off, or fewer instances came than were announced, and the series was not
        /// made whole since: by word, by count, or by a sender that began later and brought what
        /// lacked.
        IncompleteTransfer = "incomplete_transfer",
        /// Instances of it were refused (damaged, of another study, other pixels under a UID that is
        /// stored) and did not come again in a way that they could be stored, nor did a word say that it
        /// is complete without them.
        InstancesRefused = "instances_refused",
        /// Release 0.1 made it with a decoder that could read JPEG Lossless wrongly without an error, from
        /// instances that are JPEG Lossless or, no longer stored, may have been. Of a series: what is served
        /// of it is such a one.
        FormerDecoder = "former_decoder",
    }
}

named! {
    /// Where a reconstruction stands.
    ReconstructionState {
        /// Waits for a worker.
        Queued = "queued",
        /// A worker has it.
        Running = "running",
        /// Its cloud and report are served.
        Succeeded = "succeeded",
        /// It gave no cloud; see its error.
        Failed = "failed",
        /// Somebody cancelled it.
        Cancelled = "cancelled",
        /// It succeeded, and a later revision of its series has taken its place. Still served.
        Superseded = "superseded",
    }
}

impl ReconstructionState {
    /// Whether nothing more will happen to it but being superseded.
    #[must_use]
    pub fn is_final(self) -> bool {
        !matches!(self, Self::Queued | Self::Running)
    }
    /// Whether a cloud is served.
    #[must_use]
    pub fn has_cloud(self) -> bool {
        matches!(self, Self::Succeeded | Self::Superseded)
    }
}

/// Identity of a reconstruction: a UUIDv7.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, utoipa::ToSchema,
)]
#[serde(transparent)]
pub struct ReconstructionId(pub Uuid);

impl ReconstructionId {
    /// A new one, later than all before.
    #[must_use]
    pub fn new() -> Self {
        Self(Uuid::now_v7())
    }
}

impl Default for ReconstructionId {
    fn default() -> Self {
        Self::new()
    }
}

impl fmt::Display for ReconstructionId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl FromStr for ReconstructionId {
    type Err = uuid::Error;
    fn from_str(text: &str) -> Result<Self, uuid::Error> {
        text.parse().map(Self)
    }
}

/// A stored instance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InstanceRecord {
    /// What its header says.
    pub header: InstanceHeader,
    /// Where its bytes are among the blobs.
    pub blob: String,
    /// Bytes of the Part 10 file.
    pub size: u64,
    /// SHA-256 of the data set's bytes as they came, without the file meta group.
    pub data_set_sha256: [u8; 32],
    /// What stands for its pixels and geometry in the identity of its set: the `data_set_sha256` of the
    /// data set that was stored first. A corrected identity leaves it as it is.
    pub image_sha256: [u8; 32],
    /// When it was acknowledged.
    pub received_ms: i64,
}

/// A series.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SeriesRecord {
    /// Series Instance UID.
    pub series_instance_uid: SeriesInstanceUid,
    /// Study Instance UID.
    pub study_instance_uid: StudyInstanceUid,
    /// Frame of Reference UID of its first instance.
    pub frame_of_reference_uid: Option<FrameOfReferenceUid>,
    /// Modality of its first instance.
    pub modality: Option<String>,
    /// Series Description of its first instance.
    pub description: Option<String>,
    /// Patient ID; never logged.
    pub patient_id: Option<String>,
    /// Accession Number; never logged.
    pub accession_number: Option<String>,
    /// State.
    pub state: SeriesState,
    /// Why it can't be reconstructed, if it can't.
    pub unfit_reason: Option<UnfitReason>,
    /// 1 at the first completion, one more for each later set of instances; 0 before.
    pub revision: u32,
    /// What completed the latest revision.
    pub complete_reason: Option<CompleteReason>,
    /// How the sender that ended last ended.
    pub sender_end: Option<SenderEnd>,
    /// Why it may not be what its sender meant to send, or what is served of it not what it shows.
    pub doubts: Vec<TransferDoubt>,
    /// Identity of the set of instances of the latest revision; `None` before the first.
    pub instances_sha256: Option<[u8; 32]>,
    /// Instances that the sender announced.
    pub expected_instances: Option<u64>,
    /// Instances stored.
    pub instances: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Instances that were ever refused (see [`Refused`]).
    pub refused_instances: u64,
    /// Some of its instances came again with another identity, others did not yet.
    pub identity_changing: bool,
    /// When its first instance came.
    pub created_ms: i64,
    /// When its latest instance came.
    pub updated_ms: i64,
}

/// A change of a series' identity that is over: every instance carries the new one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct IdentityChange {
    /// What of it has changed.
    pub fields: Vec<IdentityField>,
    /// When the last instance of it came, Unix ms.
    pub changed_ms: i64,
}

/// Instances of a series that came again with other attributes, beside their pixels, geometry and identity.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AttributeChange {
    /// How many.
    pub instances: u64,
    /// When the last of them came, Unix ms.
    pub changed_ms: i64,
}

/// An instance that was refused although its series is known; stands in the report.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Refused {
    /// The instance.
    pub sop_instance_uid: SopInstanceUid,
    /// Its study, where that was read.
    pub study_instance_uid: Option<StudyInstanceUid>,
    /// Whether the refusal is a doubt of the series.
    pub held: bool,
    /// The refusal's code, as in the problem's URN.
    pub code: String,
    /// How often it was sent.
    pub times: u64,
    /// When it was refused last, Unix ms.
    pub last_ms: i64,
}

/// A sender that broke off, which is held against a series.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BrokenTransfer {
    /// How it ended.
    pub end: SenderEnd,
    /// Instances that are known to have been under way and are not stored.
    pub missing: u64,
}

/// A reconstruction.
#[derive(Debug, Clone, PartialEq)]
pub struct ReconstructionRecord {
    /// Its id.
    pub id: ReconstructionId,
    /// Its series.
    pub series_instance_uid: SeriesInstanceUid,
    /// The series' revision that it was made from.
    pub revision: u32,
    /// SHA-256 over the sorted identities of the instances that it was made from.
    pub instances_sha256: [u8; 32],
    /// How many they are.
    pub instances: u64,
    /// Its parameters.
    pub parameters: Parameters,
    /// State.
    pub state: ReconstructionState,
    /// What runs now; `null` while it waits and once it has ended.
    pub stage: Option<Stage>,
    /// Part of the whole that is done, 0 to 1: 1 once it has succeeded, 0 if it ended otherwise.
    pub fraction: f64,
    /// Attempts begun.
    pub attempts: u32,
    /// Stable code of a failure, e.g. `empty_cloud`, `missing_slice`, `worker_died`.
    pub error_code: Option<String>,
    /// What failed and what to do next.
    pub error_detail: Option<String>,
    /// SOP instances that a failure names.
    pub error_instances: Vec<SopInstanceUid>,
    /// The reconstruction that took its place.
    pub superseded_by: Option<ReconstructionId>,
    /// Software that made it.
    pub software: String,
    /// The algorithm that made it and its version, e.g. `precise/1`.
    pub algorithm: String,
    /// Figures of the result.
    pub figures: Option<Figures>,
    /// How far the result can be trusted, where its profile tells.
    pub quality: Option<Quality>,
    /// The doubts of the transfer of its revision, and that of the decoder that it was made with.
    pub transfer_doubts: Vec<TransferDoubt>,
    /// Whether a report is stored (a failed one can have one).
    pub has_report: bool,
    /// Whether what its slices' pictures are drawn from is stored; results of 0.1 have none of it.
    pub has_pictures: bool,
    /// When it was asked for.
    pub created_ms: i64,
    /// When its last attempt began.
    pub started_ms: Option<i64>,
    /// When it reached a final state.
    pub finished_ms: Option<i64>,
}

impl ReconstructionRecord {
    /// Whether it was made with the decoder of release 0.1 from what that could read wrongly.
    #[must_use]
    pub fn is_of_former_decoder(&self) -> bool {
        self.transfer_doubts.contains(&TransferDoubt::FormerDecoder)
    }

    /// Whether it is of the latest revision of its series, or of the same instances.
    #[must_use]
    pub fn is_of_latest(&self, series: &SeriesRecord) -> bool {
        self.revision >= series.revision || series.instances_sha256 == Some(self.instances_sha256)
    }
}

/// The clinical reconstruction of a series: the one that is served for it.
#[derive(Debug, Clone, PartialEq)]
pub struct Clinical {
    /// Which.
    pub reconstruction: ReconstructionRecord,
    /// Whether an operator chose it.
    pub chosen: bool,
}

/// An operator's choice of the clinical reconstruction.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ClinicalChoice {
    /// The series' revision then.
    pub revision: u32,
    /// Which was chosen; `None`: back to the one that the service queued itself.
    pub reconstruction: Option<ReconstructionId>,
    /// Name of the operator's token; `None` where no tokens are configured.
    pub chosen_by: Option<String>,
    /// When, Unix ms.
    pub chosen_ms: i64,
}

/// Which series a list shows.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SeriesFilter {
    /// Exactly this Patient ID.
    pub patient_id: Option<String>,
    /// Exactly this Accession Number.
    pub accession_number: Option<String>,
    /// Of this study.
    pub study_instance_uid: Option<StudyInstanceUid>,
    /// In this state.
    pub state: Option<SeriesState>,
}

/// Which reconstructions a list shows.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ReconstructionFilter {
    /// Of this series.
    pub series_instance_uid: Option<SeriesInstanceUid>,
    /// In this state.
    pub state: Option<ReconstructionState>,
}

/// A row that this version of the software can't understand: a later one wrote it, or it is damaged.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, utoipa::ToSchema)]
pub struct UnreadableRow {
    /// Its id.
    pub id: String,
    /// Why, and what to do next.
    pub detail: String,
}

/// One page of a list, newest first.
#[derive(Debug, Clone, PartialEq)]
pub struct Page<T> {
    /// The rows.
    pub rows: Vec<T>,
    /// What stands in its place but can't be understood by this version of the software.
    pub unreadable: Vec<UnreadableRow>,
    /// Opaque; asks for the next page. `None` on the last one.
    pub next_cursor: Option<String>,
}
