//! What a reconstruction gives.

use serde::{Deserialize, Serialize};

use super::rejection::Rejection;
use crate::cloud::PointCloud;
use crate::geometry::Plane;

/// Clouds, figures and a row for every slice, of one run of the pipeline.
#[derive(Debug, Clone)]
pub struct Reconstruction {
    /// The merged, downsampled cloud without outliers: the result. LPS mm.
    pub triplanar: PointCloud,
    /// The downsampled cloud of each plane alone, in the order of [`Plane::ALL`]. LPS mm.
    pub uniplanar: [PointCloud; 3],
    /// The paper's figures.
    pub figures: Figures,
    /// One row for every slice: axial, then sagittal, then coronal, each by index.
    pub slices: Vec<SliceRow>,
}

/// The decision on one slice.
#[derive(Debug, Clone, PartialEq)]
pub struct SliceRow {
    /// The plane.
    pub plane: Plane,
    /// Index within the plane: axial from the top, sagittal from the patient's right, coronal from
    /// the back.
    pub index: usize,
    /// `None` for an accepted slice.
    pub rejection: Option<Rejection>,
    /// Area of the cut contour in px², if there is one.
    pub contour_area: Option<f64>,
    /// Contour area / area of its convex hull.
    pub solidity: Option<f64>,
    /// Number of pixels of the cut contour.
    pub contour_points: usize,
    /// Carried area before and after the slice, px².
    pub carried_area: (Option<f64>, Option<f64>),
}

/// The figures that the paper reports for each result (its section 3), and the points after each
/// stage. All are counts of points unless they say share.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Figures {
    /// Contour pixels lifted into patient space: axial, sagittal, coronal.
    pub raw: [u64; 3],
    /// Contour pixels of accepted slices that were left out: they lie outside the bounding box of the
    /// axial points in x and y. Axial (always 0), sagittal, coronal.
    #[serde(default)]
    pub outside_axial_box: [u64; 3],
    /// After each plane's own voxel grid: axial, sagittal, coronal.
    pub downsampled: [u64; 3],
    /// After merging and the second voxel grid.
    pub merged: u64,
    /// After radius outlier removal.
    pub after_radius: u64,
    /// After statistical outlier removal: the final cloud.
    pub after_statistical: u64,
    /// Points of the final cloud with no axial point within 1 mm.
    pub unique: u64,
    /// `unique` / final, 0 to 1.
    pub unique_share: f64,
    /// Points of the merged cloud beyond those of the axial one (may be negative).
    pub additional_over_axial: i64,
    /// `additional_over_axial` / axial downsampled, 0 to 1.
    pub additional_share: f64,
}

/// Why the pipeline gave no cloud.
#[derive(Debug, Clone, thiserror::Error)]
pub enum PipelineError {
    /// Not one point is left. The rows tell which tests rejected the slices.
    #[error("no point of skin is left after {stage}: see the report for the reason of every slice")]
    EmptyCloud {
        /// The step after which nothing was left.
        stage: &'static str,
        /// What was found up to there.
        partial: Box<Reconstruction>,
    },
    /// The observer asked to stop.
    #[error("cancelled")]
    Cancelled,
}
