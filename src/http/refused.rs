//! What of an upload was refused or passed over, as answers tell it.

use serde::{Deserialize, Serialize};

/// An instance that was refused.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Refusal {
    /// Its file name in the upload; empty if it has none.
    pub name: String,
    /// Stable code, as in the problem's URN.
    #[schema(examples("conflicting-instance"))]
    pub code: String,
    /// What was wrong and what to do next.
    pub detail: String,
}

/// A file that is no DICOM instance.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Skipped {
    /// Its file name in the archive.
    #[schema(examples("CD/README.TXT"))]
    pub name: String,
    /// Why it was passed over.
    pub reason: SkipReason,
}

/// Why a file of an archive was passed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SkipReason {
    /// It is no DICOM data set.
    NotDicom,
    /// It is empty, or begins with nothing but zeros, as a broken copy leaves it.
    Empty,
    /// It is the index of a medium, not an instance.
    Dicomdir,
    /// It is encrypted.
    Encrypted,
    /// It is compressed in a way that is not read here.
    UnsupportedCompression,
}
