//! Test 9: a small contour may not reach the last rows, where holder and table lie (paper,
//! section 2.2, "locations of medical equipment").

use serde::{Deserialize, Serialize};

use crate::geometry::Plane;
use crate::pipeline::paper::contour::Outline;
use crate::pipeline::parameters::Thresholds;
use crate::pipeline::result::{Reason, Rejection};

/// Sagittal and coronal contours smaller than `max_area`: any white pixel in the last `rows` rows
/// rejects, as does an image of fewer rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LowerBandThresholds {
    /// px² (published program: 30000).
    pub max_area: f64,
    /// px (published program: 30).
    pub rows: u32,
}

impl Default for LowerBandThresholds {
    fn default() -> Self {
        Self { max_area: 30_000.0, rows: 30 }
    }
}

pub(super) fn test(outline: &Outline, thresholds: &Thresholds) -> Option<Rejection> {
    let limits = &thresholds.lower_band;
    if outline.plane == Plane::Axial || outline.contour.area >= limits.max_area {
        return None;
    }
    let height = outline.picture.height();
    let start = height.saturating_sub(limits.rows as usize);
    let white = (start..height).map(|row| outline.picture.white_in_row(row)).sum::<usize>();
    (white > 0 || height < limits.rows as usize).then(|| Rejection::count(Reason::LowerBand30Rows, white, 0))
}
