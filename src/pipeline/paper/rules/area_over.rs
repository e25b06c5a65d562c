//! Test 3: after a jump of the area, the contour may not be larger than a head.

use serde::{Deserialize, Serialize};

use super::Measures;
use crate::pipeline::parameters::Thresholds;
use crate::pipeline::result::{Reason, Rejection};

/// After a jump, a contour larger than `max_area` is rejected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AreaOverThresholds {
    /// px² (published program: 120000).
    pub max_area: f64,
}

impl Default for AreaOverThresholds {
    fn default() -> Self {
        Self { max_area: 120_000.0 }
    }
}

pub(super) fn test(measures: &Measures, _carried: f64, thresholds: &Thresholds) -> Option<Rejection> {
    let limit = thresholds.area_over.max_area;
    (measures.area > limit).then_some(Rejection {
        reason: Reason::AreaOver120000,
        measured: measures.area,
        limit,
    })
}
