//! Test 10: a contour that is not large may not reach the last row.

use serde::{Deserialize, Serialize};

use crate::geometry::Plane;
use crate::pipeline::paper::contour::Outline;
use crate::pipeline::parameters::Thresholds;
use crate::pipeline::result::{Reason, Rejection};

/// Sagittal and coronal contours smaller than `max_area`: any white pixel in the last row rejects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LastRowThresholds {
    /// px² (published program: 50000).
    pub max_area: f64,
}

impl Default for LastRowThresholds {
    fn default() -> Self {
        Self { max_area: 50_000.0 }
    }
}

pub(super) fn test(outline: &Outline, thresholds: &Thresholds) -> Option<Rejection> {
    if outline.plane == Plane::Axial || outline.contour.area >= thresholds.last_row.max_area {
        return None;
    }
    let white = outline.picture.white_in_row(outline.picture.height() - 1);
    (white > 0).then(|| Rejection::count(Reason::LastRow, white, 0))
}
