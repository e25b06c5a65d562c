//! Which contours may belong to the head.

use serde::{Deserialize, Serialize};

use super::polygon;
use crate::geometry::Plane;
use crate::pipeline::slices::Pixel;

/// A contour is kept if its area exceeds `min_area` and its centroid lies inside the plane's
/// window, all limits exclusive (paper, section 2.2; the values are the published program's, in
/// pixels of a 512 × 512 image).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ContourThresholds {
    /// px² (500).
    pub min_area: f64,
    /// Axial slices: the centroid's column and row lie above this, px (140),
    pub axial_window_min: f64,
    /// and below this, px (360).
    pub axial_window_max: f64,
    /// Sagittal and coronal slices: the centroid's column lies above this, px (100),
    pub upright_window_min_column: f64,
    /// and below this, px (400).
    pub upright_window_max_column: f64,
    /// Sagittal and coronal slices: the centroid's row lies above this, px (10).
    pub upright_window_min_row: f64,
}

impl Default for ContourThresholds {
    fn default() -> Self {
        Self {
            min_area: 500.0,
            axial_window_min: 140.0,
            axial_window_max: 360.0,
            upright_window_min_column: 100.0,
            upright_window_max_column: 400.0,
            upright_window_min_row: 10.0,
        }
    }
}

impl ContourThresholds {
    /// Whether the contour may belong to the head.
    pub(super) fn keeps(&self, contour: &[Pixel], plane: Plane) -> bool {
        polygon::area(contour) > self.min_area
            && polygon::centroid(contour).is_some_and(|centroid| self.is_central(centroid, plane))
    }

    fn is_central(&self, [column, row]: [f32; 2], plane: Plane) -> bool {
        let (column, row) = (f64::from(column), f64::from(row));
        let between = |value: f64, min: f64, max: f64| min < value && value < max;
        match plane {
            Plane::Axial => {
                between(column, self.axial_window_min, self.axial_window_max)
                    && between(row, self.axial_window_min, self.axial_window_max)
            }
            Plane::Sagittal | Plane::Coronal => {
                between(column, self.upright_window_min_column, self.upright_window_max_column)
                    && row > self.upright_window_min_row
            }
        }
    }
}
