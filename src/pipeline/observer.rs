//! How a running reconstruction tells how far it is, and is told to stop.

use serde::{Deserialize, Serialize};

/// A stage of a reconstruction, in the order in which they run.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, utoipa::ToSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Instances are read and decoded into a volume.
    Reading,
    /// Axial slices: mask, contour, tests.
    Axial,
    /// Sagittal slices.
    Sagittal,
    /// Coronal slices.
    Coronal,
    /// Points to patient space, voxel grids, merging.
    Downsampling,
    /// Outlier removal and unique points.
    Outliers,
    /// The results are stored.
    Writing,
}

impl Stage {
    /// All stages in order.
    pub const ALL: [Self; 7] = [
        Self::Reading,
        Self::Axial,
        Self::Sagittal,
        Self::Coronal,
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
            Self::Downsampling => "downsampling",
            Self::Outliers => "outliers",
            Self::Writing => "writing",
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
