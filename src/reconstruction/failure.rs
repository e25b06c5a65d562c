//! Why there is no cloud.

use super::Report;
use crate::dicom::uid::SopInstanceUid;

/// A reconstruction that gave no cloud.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{code}: {detail}")]
pub struct Failure {
    /// Stable code, e.g. `empty_cloud`, `missing_slice`, `cancelled`, `unreadable_source`.
    pub code: String,
    /// What went wrong and what to do next.
    pub detail: String,
    /// The instances that are at fault, if some are.
    pub instances: Vec<SopInstanceUid>,
    /// The report, where the pipeline got far enough to have one: with a row for every slice.
    pub report: Option<Box<Report>>,
    /// Whether the same instances may go through later: the storage failed, not the data.
    pub transient: bool,
}

impl Failure {
    /// The code of a run in which no point was left.
    pub const EMPTY_CLOUD: &'static str = "empty_cloud";
    /// The code of a run that its observer stopped.
    pub const CANCELLED: &'static str = "cancelled";
}
