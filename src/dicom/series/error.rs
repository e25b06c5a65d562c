//! Why a series is no volume.

use crate::dicom::uid::SopInstanceUid;

/// Why a series can't be read, with the instances that are to blame.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{detail}")]
pub struct SeriesError {
    code: &'static str,
    detail: String,
    instances: Vec<SopInstanceUid>,
}

impl SeriesError {
    pub(super) fn new(code: &'static str, detail: impl Into<String>, instances: Vec<SopInstanceUid>) -> Self {
        Self { code, detail: detail.into(), instances }
    }

    /// The stable code, e.g. `missing_slice`.
    #[must_use]
    pub fn code(&self) -> &'static str {
        self.code
    }

    /// The offending instances, sorted; empty if it is not about some of them. Those of
    /// `mixed_patient` and `mixed_study` stand set after set, the largest first, as the message counts
    /// them.
    #[must_use]
    pub fn instances(&self) -> &[SopInstanceUid] {
        &self.instances
    }
}
