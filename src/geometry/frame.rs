//! The two patient frames in which a cloud is served.

use serde::{Deserialize, Serialize};

/// A patient coordinate frame, in mm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum Frame {
    /// Left, posterior, superior: DICOM's own (PS3.3 C.7.6.2.1.1).
    #[default]
    Lps,
    /// Right, anterior, superior: LPS with x and y negated.
    Ras,
}

impl Frame {
    /// A point given in LPS, in this frame.
    #[must_use]
    pub fn from_lps(self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Lps => [x, y, z],
            Self::Ras => [-x, -y, z],
        }
    }

    /// `"lps"` or `"ras"`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Lps => "lps",
            Self::Ras => "ras",
        }
    }
}
