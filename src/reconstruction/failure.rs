//! Why there is no cloud.

use super::{Report, ReportError};
use crate::dicom::series::{self, SeriesError};
use crate::dicom::uid::SopInstanceUid;

/// A reconstruction that gave no cloud.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{code}: {detail}")]
pub struct Failure {
    /// Stable code, e.g. `empty_cloud`, `no_head`, `missing_slice`, `cancelled`.
    pub code: String,
    /// What went wrong and what to do next.
    pub detail: String,
    /// The instances that are at fault, if some are.
    pub instances: Vec<SopInstanceUid>,
    /// The report, where the pipeline got far enough to have one: with a row for every slice.
    pub report: Option<Box<Report>>,
    /// What its slices' pictures are drawn from, where there is a report and that was asked for.
    pub pictures: Option<Vec<u8>>,
    /// Whether the same instances may go through later: the storage failed, not the data.
    pub transient: bool,
}

impl Failure {
    /// The code of a run that its observer stopped.
    pub const CANCELLED: &'static str = "cancelled";
    /// The code of instances that the storage did not give.
    pub const UNREADABLE: &'static str = "unreadable";

    /// The code of a run for which others left no memory: it goes through when they have ended.
    pub const OUT_OF_MEMORY: &'static str = series::OUT_OF_MEMORY;

    pub(super) fn cancelled() -> Self {
        Self::lasting(Self::CANCELLED, "the reconstruction was cancelled".to_owned())
    }

    /// One without a report that is the same when it is tried again.
    pub(super) fn lasting(code: &str, detail: String) -> Self {
        Self {
            code: code.to_owned(),
            detail,
            instances: Vec::new(),
            report: None,
            pictures: None,
            transient: false,
        }
    }

    /// The series is no volume.
    pub(super) fn from_series(error: SeriesError) -> Self {
        Self {
            code: error.code().to_owned(),
            detail: error.to_string(),
            instances: error.instances().to_vec(),
            report: None,
            pictures: None,
            transient: [Self::UNREADABLE, Self::OUT_OF_MEMORY].contains(&error.code()),
        }
    }

    /// The pipeline gave no point; the report has a row for every slice.
    pub(super) fn without_cloud(code: &str, detail: String, mut report: Report) -> Self {
        let code = code.to_owned();
        report.error = Some(ReportError { code: code.clone(), detail: detail.clone() });
        Self {
            code,
            detail,
            instances: Vec::new(),
            report: Some(Box::new(report)),
            pictures: None,
            transient: false,
        }
    }
}
