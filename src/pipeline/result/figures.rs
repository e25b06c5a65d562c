//! The counts and shares of a reconstruction.

use serde::{Deserialize, Serialize};

use crate::cloud::PointCloud;

/// The figures that the paper reports for each result (its section 3), and the points after each
/// stage. All are counts of points unless they say share. `precise` has no filters after merging:
/// its counts of merging and of both filters are that of the final cloud.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Figures {
    /// Contour pixels lifted into patient space (`paper`), crossings measured (`precise`): axial,
    /// sagittal, coronal.
    pub raw: [u64; 3],
    /// Contour pixels of accepted slices that were left out: they lie outside the bounding box of the
    /// axial points in x and y. Axial (always 0), sagittal, coronal.
    #[serde(default)]
    pub outside_axial_box: [u64; 3],
    /// Points of each plane's own cloud, one a cell or leaf: axial, sagittal, coronal.
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

/// The number of points of a cloud.
pub(crate) fn count(cloud: &PointCloud) -> u64 {
    cloud.len() as u64
}

/// The share `part` / `whole`; 0 of nothing.
#[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53 points")]
pub(crate) fn share(part: i64, whole: u64) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}
