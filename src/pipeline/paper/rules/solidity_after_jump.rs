//! Test 5: after a jump of the area, a contour of any size must be fairly convex.

use serde::{Deserialize, Serialize};

use super::Measures;
use crate::pipeline::parameters::Thresholds;
use crate::pipeline::result::{Reason, Rejection};

/// After a jump, a contour whose solidity is below `min_solidity` is rejected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SolidityAfterJumpThresholds {
    /// Contour area / area of its convex hull (published program: 0.75).
    pub min_solidity: f64,
}

impl Default for SolidityAfterJumpThresholds {
    fn default() -> Self {
        Self { min_solidity: 0.75 }
    }
}

pub(super) fn test(measures: &Measures, _carried: f64, thresholds: &Thresholds) -> Option<Rejection> {
    let limit = thresholds.solidity_after_jump.min_solidity;
    (measures.solidity < limit).then_some(Rejection {
        reason: Reason::Solidity075,
        measured: measures.solidity,
        limit,
    })
}
