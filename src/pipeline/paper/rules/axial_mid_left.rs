//! Test 11: a small axial contour may not come with tissue far to the left in the middle row.

use serde::{Deserialize, Serialize};

use crate::geometry::Plane;
use crate::pipeline::paper::bitmap::BLACK;
use crate::pipeline::paper::contour::Outline;
use crate::pipeline::parameters::Thresholds;
use crate::pipeline::result::{Reason, Rejection};

/// Axial contours smaller than `max_area`: any white pixel in the first columns of the middle row
/// rejects: the first width / `width_divisor` of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AxialMidLeftThresholds {
    /// px² (published program: 10000).
    pub max_area: f64,
    /// The part of the width that is looked at (published program: 4, a quarter).
    #[schema(minimum = 1)]
    pub width_divisor: u32,
}

impl Default for AxialMidLeftThresholds {
    fn default() -> Self {
        Self { max_area: 10_000.0, width_divisor: 4 }
    }
}

pub(super) fn test(outline: &Outline, thresholds: &Thresholds) -> Option<Rejection> {
    let limits = &thresholds.axial_mid_left;
    if outline.plane != Plane::Axial || outline.contour.area >= limits.max_area {
        return None;
    }
    let picture = &outline.picture;
    let columns = picture.width() / limits.width_divisor.max(1) as usize;
    let white = picture.row(picture.height() / 2).iter().take(columns).filter(|&&p| p != BLACK).count();
    (white > 0).then(|| Rejection::count(Reason::AxialMidLeft, white, 0))
}
