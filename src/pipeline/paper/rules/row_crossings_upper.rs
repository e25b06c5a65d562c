//! Test 6: rows of the upper half that cross the contour too often show inner structures
//! (paper, section 2.2, pixel counting filter).

use serde::{Deserialize, Serialize};

use super::row_crossings::crossings;
use crate::geometry::Plane;
use crate::pipeline::paper::contour::Outline;
use crate::pipeline::parameters::Thresholds;
use crate::pipeline::result::{Reason, Rejection};

/// Sagittal and coronal contours larger than `min_area`: rows from `first_row` to half the height
/// are bad with so many crossings, and `bad_rows` of them reject. Sagittal rows are walked from
/// the right edge, coronal ones from the middle, to the left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RowCrossingsUpperThresholds {
    /// px² (published program: 15000).
    pub min_area: f64,
    /// px (published program: 8).
    pub first_row: u32,
    /// Sagittal: every so many rows, px (paper: 4).
    #[schema(minimum = 1)]
    pub sagittal_row_step: u32,
    /// Coronal: every so many rows, px (published program: 8).
    #[schema(minimum = 1)]
    pub coronal_row_step: u32,
    /// Sagittal: crossings of a bad row (paper: 4).
    pub sagittal_crossings: u32,
    /// Coronal: crossings of a bad row (published program: 3).
    pub coronal_crossings: u32,
    /// Columns between two crossings, px (paper: 4).
    pub gap: u32,
    /// So many bad rows reject (paper: 4).
    pub bad_rows: u32,
}

impl Default for RowCrossingsUpperThresholds {
    fn default() -> Self {
        Self {
            min_area: 15_000.0,
            first_row: 8,
            sagittal_row_step: 4,
            coronal_row_step: 8,
            sagittal_crossings: 4,
            coronal_crossings: 3,
            gap: 4,
            bad_rows: 4,
        }
    }
}

pub(super) fn test(outline: &Outline, thresholds: &Thresholds) -> Option<Rejection> {
    let limits = &thresholds.row_crossings_upper;
    let (width, height) = (outline.picture.width(), outline.picture.height());
    let (step, from, most) = match outline.plane {
        Plane::Axial => return None,
        Plane::Sagittal => (limits.sagittal_row_step, width - 1, limits.sagittal_crossings),
        Plane::Coronal => (limits.coronal_row_step, width / 2, limits.coronal_crossings),
    };
    if outline.contour.area <= limits.min_area {
        return None;
    }
    let bad_rows = (limits.first_row as usize..=height / 2)
        .step_by(step.max(1) as usize)
        .filter(|&row| crossings(&outline.picture, row, from, limits.gap as usize) >= most as usize)
        .count();
    (bad_rows >= limits.bad_rows as usize)
        .then(|| Rejection::count(Reason::RowCrossingsUpper, bad_rows, limits.bad_rows))
}
