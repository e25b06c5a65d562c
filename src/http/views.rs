//! What the API says of series and reconstructions. Times are RFC 3339, UTC.

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use crate::dicom::identity::IdentityField;
use crate::dicom::series::UnfitReason;
use crate::dicom::uid::{FrameOfReferenceUid, SeriesInstanceUid, SopInstanceUid, StudyInstanceUid};
use crate::observer::Stage;
use crate::pipeline::precise::Quality;
use crate::pipeline::{Figures, Parameters};
use crate::store::{
    AttributeChange, ClinicalChoice, CompleteReason, IdentityChange, Page, ReconstructionId,
    ReconstructionRecord, ReconstructionState, Refused, SenderEnd, SeriesRecord, SeriesState, TransferDoubt,
    UnreadableRow,
};

/// A series.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct SeriesView {
    /// Series Instance UID (0020,000E).
    pub series_instance_uid: SeriesInstanceUid,
    /// Study Instance UID (0020,000D).
    pub study_instance_uid: StudyInstanceUid,
    /// Frame of Reference UID (0020,0052).
    pub frame_of_reference_uid: Option<FrameOfReferenceUid>,
    /// Modality (0008,0060).
    #[schema(examples("CT"))]
    pub modality: Option<String>,
    /// Series Description (0008,103E).
    pub description: Option<String>,
    /// Patient ID (0010,0020).
    pub patient_id: Option<String>,
    /// Accession Number (0008,0050).
    pub accession_number: Option<String>,
    /// Where it stands.
    pub state: SeriesState,
    /// Why it can't be reconstructed, where it can't.
    pub unfit_reason: Option<UnfitReason>,
    /// 0 before it is complete; one more with each set of instances that it was complete with.
    pub revision: u32,
    /// What completed the latest revision.
    pub complete_reason: Option<CompleteReason>,
    /// How the sender that ended last ended.
    pub sender_end: Option<SenderEnd>,
    /// Why it may not be what its sender meant to send. `incomplete_transfer`: a sender broke off, or
    /// fewer instances came than were announced, and nothing made the series whole since (a word, the
    /// expected number, a later sender that brought what lacked and ended well). `instances_refused`:
    /// instances of it were refused and are not stored. `former_decoder`: release 0.1 made what is served
    /// of it, with a decoder that could read JPEG Lossless wrongly.
    pub doubts: Vec<TransferDoubt>,
    /// Instances that the sender announced.
    pub expected_instances: Option<u64>,
    /// Instances stored.
    pub instances: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Instances that were ever refused; see `refused`.
    pub refused_instances: u64,
    /// Some of its instances came again with a corrected identity, others did not yet: until all have,
    /// its cloud, report and pictures answer 409, and patient and accession number are the former ones.
    pub identity_changing: bool,
    /// When its first instance came.
    #[schema(format = DateTime)]
    pub created: String,
    /// When its latest instance came.
    #[schema(format = DateTime)]
    pub updated: String,
    /// Where to go from here.
    pub links: SeriesLinks,
}

/// Paths of a series.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct SeriesLinks {
    /// The series itself.
    #[serde(rename = "self")]
    pub itself: String,
    /// Its reconstructions.
    pub reconstructions: String,
    /// The cloud of its clinical reconstruction.
    pub cloud: String,
    /// The report of the same.
    pub report: String,
}

/// The reconstruction that is served for a series.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct ClinicalView {
    /// Its id; `null` while there is none with a cloud.
    pub reconstruction: Option<ReconstructionId>,
    /// The revision that it was made from.
    pub revision: Option<u32>,
    /// Whether an operator chose it; else it is the one that the service queued itself.
    pub chosen: bool,
    /// How far a newer revision is, where there is or will be one: `receiving`, `queued`, `running`,
    /// `failed`, `cancelled`, `not_reconstructable`, `removed`; `succeeded` or `superseded` where an
    /// operator chose one of an earlier revision all the same.
    pub newer_revision: Option<String>,
    /// What operators chose, oldest first.
    pub choices: Vec<ClinicalChoiceView>,
}

/// An operator's choice.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct ClinicalChoiceView {
    /// The series' revision then.
    pub revision: u32,
    /// Which was chosen; `null`: back to the one that the service queued itself.
    pub reconstruction: Option<ReconstructionId>,
    /// Name of the token; `null` where none are configured.
    pub chosen_by: Option<String>,
    /// When.
    #[schema(format = DateTime)]
    pub chosen: String,
}

impl From<ClinicalChoice> for ClinicalChoiceView {
    fn from(choice: ClinicalChoice) -> Self {
        Self {
            revision: choice.revision,
            reconstruction: choice.reconstruction,
            chosen_by: choice.chosen_by,
            chosen: time(choice.chosen_ms),
        }
    }
}

/// A series, with what the list leaves out.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct SeriesDetail {
    /// The series.
    #[serde(flatten)]
    pub series: SeriesView,
    /// What was found and the limit, where there is an `unfit_reason`.
    #[schema(examples("2 slices, intake.min_slices is 10"))]
    pub unfit_detail: Option<String>,
    /// Its latest reconstruction.
    pub reconstruction: Option<ReconstructionView>,
    /// The reconstruction whose cloud and report are served for it.
    pub clinical: ClinicalView,
    /// What each of its doubts is about.
    pub doubt_details: Vec<DoubtView>,
    /// The instances that were refused.
    pub refused: Vec<RefusedView>,
    /// What happened to its identity, the first event first.
    pub history: Vec<HistoryView>,
}

/// Something that happened to the attributes of a series.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct HistoryView {
    /// `identity_changed`: its instances came again with a corrected identity, and all carry it.
    /// `attributes_changed`: instances came again with other attributes beside pixels, geometry and
    /// identity, and are stored as they came last.
    #[schema(examples("identity_changed"))]
    pub event: &'static str,
    /// What of the identity was corrected; what it was before is not kept.
    pub fields: Vec<IdentityField>,
    /// How many instances came again, of `attributes_changed`.
    pub instances: Option<u64>,
    /// When the last instance of the correction came.
    #[schema(format = DateTime)]
    pub at: String,
}

/// What a doubt of a series' transfer is about.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct DoubtView {
    /// The doubt.
    pub doubt: TransferDoubt,
    /// What happened and what to do next.
    pub detail: String,
}

/// An instance that was refused although its series is known.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct RefusedView {
    /// The instance.
    pub sop_instance_uid: SopInstanceUid,
    /// Its study, where that was read.
    pub study_instance_uid: Option<StudyInstanceUid>,
    /// Whether it is a doubt of the series: until the instance is stored, or a word says that the
    /// series is complete.
    pub held: bool,
    /// Why, as in the problem's URN.
    #[schema(examples("conflicting-instance"))]
    pub code: String,
    /// How often it was sent.
    pub times: u64,
    /// When it was refused last.
    #[schema(format = DateTime)]
    pub last: String,
}

/// A reconstruction.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct ReconstructionView {
    /// Its id, a UUIDv7.
    pub id: ReconstructionId,
    /// Its series.
    pub series_instance_uid: SeriesInstanceUid,
    /// The revision of the series that it was made from.
    pub revision: u32,
    /// SHA-256 over the identities of the instances that it was made from.
    #[schema(pattern = "^[0-9a-f]{64}$")]
    pub instances_sha256: String,
    /// How many they are.
    pub instances: u64,
    /// All its parameters.
    pub parameters: Parameters,
    /// Where it stands.
    pub state: ReconstructionState,
    /// What runs now; `null` while it waits and once it has ended.
    pub stage: Option<Stage>,
    /// Part of the whole that is done, 0 to 1: 1 once it has succeeded, 0 if it ended otherwise.
    #[schema(minimum = 0.0, maximum = 1.0)]
    pub fraction: f64,
    /// Attempts begun.
    pub attempts: u32,
    /// Why there is no cloud, where it has failed.
    pub error: Option<ReconstructionError>,
    /// The reconstruction that took its place.
    pub superseded_by: Option<ReconstructionId>,
    /// Software that made it.
    pub software: String,
    /// The algorithm that made it and its version. Asking again after an upgrade that changed it makes
    /// another reconstruction; this one stays.
    #[schema(examples("precise/1"))]
    pub algorithm: String,
    /// The figures of the result.
    pub figures: Option<Figures>,
    /// How far the result can be trusted: verdict, its reasons and what was measured. Profile
    /// `precise` alone.
    pub quality: Option<Quality>,
    /// The doubts of the transfer of its revision: those of the series while that revision is its latest;
    /// they stay as they are once instances of a newer one come. And `former_decoder`: release 0.1 made it
    /// with a decoder that could read JPEG Lossless wrongly, from instances that are JPEG Lossless or, no
    /// longer stored, may have been.
    pub transfer_doubts: Vec<TransferDoubt>,
    /// When it was asked for.
    #[schema(format = DateTime)]
    pub created: String,
    /// When its latest attempt began.
    #[schema(format = DateTime)]
    pub started: Option<String>,
    /// When it ended.
    #[schema(format = DateTime)]
    pub finished: Option<String>,
    /// Where to go from here.
    pub links: ReconstructionLinks,
}

/// Why a reconstruction gave no cloud.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct ReconstructionError {
    /// Stable code. The series is no volume: that of the fault, as `missing_slice`. It shows no skin:
    /// `empty_cloud`, and under `precise` `no_head`, `no_patient`, `no_tissue` or `no_volume`; then
    /// there is a report.
    #[schema(examples("missing_slice", "no_head"))]
    pub code: String,
    /// What failed and what to do next.
    pub detail: String,
    /// The instances at fault, if it names any.
    pub instances: Vec<SopInstanceUid>,
}

/// Paths of a reconstruction; those of what does not exist (yet) are left out.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct ReconstructionLinks {
    /// The reconstruction itself.
    #[serde(rename = "self")]
    pub itself: String,
    /// Its series.
    pub series: String,
    /// Its events.
    pub events: String,
    /// Its cloud.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cloud: Option<String>,
    /// Its report.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub report: Option<String>,
}

/// One page of a list, newest first.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct PageView<T: ToSchema> {
    /// The rows.
    pub items: Vec<T>,
    /// Rows that this version of the software can't understand: a later one wrote them, or they are
    /// damaged. Left out where there are none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unreadable: Vec<UnreadableRow>,
    /// Ask for the next page with `cursor=` this; `null` on the last one.
    pub next_cursor: Option<String>,
}

fn time(unix_ms: i64) -> String {
    Timestamp::from_millisecond(unix_ms).map(|time| time.to_string()).unwrap_or_default()
}

impl From<SeriesRecord> for SeriesView {
    fn from(record: SeriesRecord) -> Self {
        let path = format!("/v1/series/{}", record.series_instance_uid);
        Self {
            links: SeriesLinks {
                reconstructions: format!("/v1/reconstructions?series={}", record.series_instance_uid),
                cloud: format!("{path}/cloud"),
                report: format!("{path}/report"),
                itself: path,
            },
            series_instance_uid: record.series_instance_uid,
            study_instance_uid: record.study_instance_uid,
            frame_of_reference_uid: record.frame_of_reference_uid,
            modality: record.modality,
            description: record.description,
            patient_id: record.patient_id,
            accession_number: record.accession_number,
            state: record.state,
            unfit_reason: record.unfit_reason,
            revision: record.revision,
            complete_reason: record.complete_reason,
            sender_end: record.sender_end,
            doubts: record.doubts,
            expected_instances: record.expected_instances,
            instances: record.instances,
            bytes: record.bytes,
            refused_instances: record.refused_instances,
            identity_changing: record.identity_changing,
            created: time(record.created_ms),
            updated: time(record.updated_ms),
        }
    }
}

impl From<IdentityChange> for HistoryView {
    fn from(change: IdentityChange) -> Self {
        Self {
            event: "identity_changed",
            fields: change.fields,
            instances: None,
            at: time(change.changed_ms),
        }
    }
}

impl From<AttributeChange> for HistoryView {
    fn from(change: AttributeChange) -> Self {
        Self {
            event: "attributes_changed",
            fields: Vec::new(),
            instances: Some(change.instances),
            at: time(change.changed_ms),
        }
    }
}

impl HistoryView {
    /// All that happened, in the order in which it did.
    pub(super) fn all(identity: Vec<IdentityChange>, attributes: Vec<AttributeChange>) -> Vec<Self> {
        let identity = identity.into_iter().map(|change| (change.changed_ms, Self::from(change)));
        let attributes = attributes.into_iter().map(|change| (change.changed_ms, Self::from(change)));
        let mut all: Vec<_> = identity.chain(attributes).collect();
        all.sort_by_key(|(at, _)| *at);
        all.into_iter().map(|(_, view)| view).collect()
    }
}

impl From<Refused> for RefusedView {
    fn from(refused: Refused) -> Self {
        Self {
            sop_instance_uid: refused.sop_instance_uid,
            study_instance_uid: refused.study_instance_uid,
            held: refused.held,
            code: refused.code,
            times: refused.times,
            last: time(refused.last_ms),
        }
    }
}

impl From<ReconstructionRecord> for ReconstructionView {
    fn from(record: ReconstructionRecord) -> Self {
        let path = format!("/v1/reconstructions/{}", record.id);
        Self {
            links: ReconstructionLinks {
                series: format!("/v1/series/{}", record.series_instance_uid),
                events: format!("{path}/events"),
                cloud: record.state.has_cloud().then(|| format!("{path}/cloud")),
                report: record.has_report.then(|| format!("{path}/report")),
                itself: path,
            },
            id: record.id,
            series_instance_uid: record.series_instance_uid,
            revision: record.revision,
            instances_sha256: hex::encode(record.instances_sha256),
            instances: record.instances,
            parameters: record.parameters,
            state: record.state,
            stage: record.stage,
            fraction: record.fraction,
            attempts: record.attempts,
            error: record.error_code.map(|code| ReconstructionError {
                code,
                detail: record.error_detail.unwrap_or_default(),
                instances: record.error_instances,
            }),
            superseded_by: record.superseded_by,
            software: record.software,
            algorithm: record.algorithm,
            figures: record.figures,
            quality: record.quality,
            transfer_doubts: record.transfer_doubts,
            created: time(record.created_ms),
            started: record.started_ms.map(time),
            finished: record.finished_ms.map(time),
        }
    }
}

impl<R, T: ToSchema + From<R>> From<Page<R>> for PageView<T> {
    fn from(page: Page<R>) -> Self {
        Self {
            items: page.rows.into_iter().map(T::from).collect(),
            unreadable: page.unreadable,
            next_cursor: page.next_cursor,
        }
    }
}
