//! Test 4: the area may not jump too far from the carried one (paper, section 2.2: "the area
//! difference between consecutive contours").

use serde::{Deserialize, Serialize};

use super::Measures;
use crate::pipeline::parameters::Thresholds;
use crate::pipeline::result::{Reason, Rejection};

/// The area jumped if it differs from the carried area by more than `min_change` and less than
/// `ignored_change`; only then the tests 2 to 5 are made. Of these, this one rejects a difference
/// above `max_change`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AreaJumpThresholds {
    /// px² (published program: 8000).
    pub min_change: f64,
    /// px² (published program: 120000).
    pub ignored_change: f64,
    /// px² (published program: 80000).
    pub max_change: f64,
}

impl Default for AreaJumpThresholds {
    fn default() -> Self {
        Self { min_change: 8_000.0, ignored_change: 120_000.0, max_change: 80_000.0 }
    }
}

impl AreaJumpThresholds {
    /// Whether the tests after a jump are to be made.
    pub(super) fn is_jump(&self, area: f64, carried: f64) -> bool {
        let change = (carried - area).abs();
        self.min_change < change && change < self.ignored_change
    }
}

pub(super) fn test(measures: &Measures, carried: f64, thresholds: &Thresholds) -> Option<Rejection> {
    let limit = thresholds.area_jump.max_change;
    let measured = (carried - measures.area).abs();
    (measured > limit).then_some(Rejection { reason: Reason::AreaJump80000, measured, limit })
}
