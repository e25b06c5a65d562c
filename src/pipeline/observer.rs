//! How a running reconstruction tells how far it is, and is told to stop.

use serde::{Deserialize, Serialize};

use super::parameters::Profile;

/// A stage of a reconstruction, in the order in which they run; each profile has its own of them
/// ([`Profile::stages`]).
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

impl Profile {
    /// The stages of a reconstruction with this profile, in their order.
    #[must_use]
    pub fn stages(self) -> &'static [Stage] {
        use Stage::{
            Axial, Coronal, Crossings, Downsampling, Outliers, Outside, Patient, Reading, Sagittal, Writing,
        };
        match self {
            Self::Paper => &[Reading, Axial, Sagittal, Coronal, Downsampling, Outliers, Writing],
            Self::Precise => &[Reading, Patient, Outside, Crossings, Downsampling, Writing],
        }
    }
}

/// Watches a reconstruction from outside. Called from several threads.
pub trait Observer: Sync {
    /// `fraction` of `stage` is done, 0 to 1.
    fn progress(&self, stage: Stage, fraction: f64);
    /// Whether the work should stop now; asked at least once a slice.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Nobody watches.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Observer for Silent {
    fn progress(&self, _: Stage, _: f64) {}
}
