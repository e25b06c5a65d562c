//! The stages of a reconstruction.

use serde::{Deserialize, Serialize};

/// A stage of a reconstruction, in the order in which they run; each profile has its own of them.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, utoipa::ToSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Instances are read and decoded into a volume.
    Reading,
    /// `paper`: axial slices: mask, contour, tests.
    Axial,
    /// `paper`: sagittal slices.
    Sagittal,
    /// `paper`: coronal slices.
    Coronal,
    /// `precise`: which tissue is the patient, and whether it is a head.
    Patient,
    /// `precise`: which border of the patient is skin.
    Outside,
    /// `precise`: where exactly the skin crosses the grid lines of the slices.
    Crossings,
    /// Points to patient space, one a cell or leaf.
    Downsampling,
    /// `paper`: outlier removal and unique points.
    Outliers,
    /// The results are stored.
    Writing,
}

impl Stage {
    /// All stages in order.
    pub const ALL: [Self; 10] = [
        Self::Reading,
        Self::Axial,
        Self::Sagittal,
        Self::Coronal,
        Self::Patient,
        Self::Outside,
        Self::Crossings,
        Self::Downsampling,
        Self::Outliers,
        Self::Writing,
    ];

    /// The stage's one name in API, log and metrics.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Reading => "reading",
            Self::Axial => "axial",
            Self::Sagittal => "sagittal",
            Self::Coronal => "coronal",
            Self::Patient => "patient",
            Self::Outside => "outside",
            Self::Crossings => "crossings",
            Self::Downsampling => "downsampling",
            Self::Outliers => "outliers",
            Self::Writing => "writing",
        }
    }
}
