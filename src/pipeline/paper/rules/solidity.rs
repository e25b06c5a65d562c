//! Test 1: a large contour must be nearly convex (paper, section 2.2, Algorithm 2).

use serde::{Deserialize, Serialize};

use crate::pipeline::paper::contour::Outline;
use crate::pipeline::parameters::Thresholds;
use crate::pipeline::result::{Reason, Rejection};

/// A contour larger than `min_area` is rejected if its solidity is below `min_solidity`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SolidityThresholds {
    /// px² (paper: 40000).
    pub min_area: f64,
    /// Contour area / area of its convex hull (paper: 0.88).
    pub min_solidity: f64,
}

impl Default for SolidityThresholds {
    fn default() -> Self {
        Self { min_area: 40_000.0, min_solidity: 0.88 }
    }
}

pub(super) fn test(outline: &Outline, thresholds: &Thresholds) -> Option<Rejection> {
    let limits = &thresholds.solidity;
    let contour = &outline.contour;
    (contour.area > limits.min_area && contour.solidity < limits.min_solidity).then_some(Rejection {
        reason: Reason::Solidity,
        measured: contour.solidity,
        limit: limits.min_solidity,
    })
}
