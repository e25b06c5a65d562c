//! Test 7: the same as test 6 in the lower half of the picture, for axial and coronal slices.

use serde::{Deserialize, Serialize};

use super::row_crossings::crossings;
use crate::geometry::Plane;
use crate::pipeline::paper::bitmap::Bitmap;
use crate::pipeline::paper::contour::Outline;
use crate::pipeline::parameters::Thresholds;
use crate::pipeline::result::{Reason, Rejection};

/// Axial and coronal contours larger than `min_area`: rows from half the height to `margin` above
/// the last row whose middle pixel is white are bad with so many crossings, walked from the right
/// edge to the left, and `bad_rows` of them reject.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RowCrossingsLowerThresholds {
    /// px² (published program: 15000).
    pub min_area: f64,
    /// Every so many rows, px (published program: 4).
    #[schema(minimum = 1)]
    pub row_step: u32,
    /// Rows left out above the last one whose middle is white, px (published program: 10).
    pub margin: u32,
    /// Where no middle is white, the last row stands so far above the lower edge, px (published
    /// program: 40).
    pub fallback_margin: u32,
    /// Columns between two crossings, px (published program: 6).
    pub gap: u32,
    /// Crossings of a bad row (published program: 4).
    pub crossings: u32,
    /// So many bad rows reject (published program: 5).
    pub bad_rows: u32,
}

impl Default for RowCrossingsLowerThresholds {
    fn default() -> Self {
        Self {
            min_area: 15_000.0,
            row_step: 4,
            margin: 10,
            fallback_margin: 40,
            gap: 6,
            crossings: 4,
            bad_rows: 5,
        }
    }
}

pub(super) fn test(outline: &Outline, thresholds: &Thresholds) -> Option<Rejection> {
    let limits = &thresholds.row_crossings_lower;
    if outline.plane == Plane::Sagittal || outline.contour.area <= limits.min_area {
        return None;
    }
    let picture = &outline.picture;
    let end = last_row(picture, limits)?.checked_sub(limits.margin as usize)?;
    let bad_rows = (picture.height() / 2..=end)
        .step_by(limits.row_step.max(1) as usize)
        .filter(|&row| {
            crossings(picture, row, picture.width() - 1, limits.gap as usize) >= limits.crossings as usize
        })
        .count();
    (bad_rows >= limits.bad_rows as usize)
        .then(|| Rejection::count(Reason::RowCrossingsLower, bad_rows, limits.bad_rows))
}

/// The last of the walked rows whose middle pixel is white.
fn last_row(picture: &Bitmap, limits: &RowCrossingsLowerThresholds) -> Option<usize> {
    let height = picture.height();
    (height / 2..height)
        .step_by(limits.row_step.max(1) as usize)
        .rfind(|&row| picture.is_white(row, picture.width() / 2))
        .or_else(|| height.checked_sub(limits.fallback_margin as usize))
}
