//! The filters against stray points, profile `paper`.

use serde::{Deserialize, Serialize};

/// A point is kept if at least `min_neighbours` others lie within `radius_mm` (inclusive).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RadiusOutlier {
    /// mm (published program: 10).
    #[schema(minimum = 0.1, maximum = 100.0)]
    pub radius_mm: f32,
    /// Other points (published program: 250). 0 switches the filter off.
    #[schema(minimum = 0, maximum = 100_000)]
    pub min_neighbours: u32,
}

impl Default for RadiusOutlier {
    fn default() -> Self {
        Self { radius_mm: 10.0, min_neighbours: 250 }
    }
}

/// A point is dropped if its mean distance to its nearest others exceeds mean + `deviations` ·
/// sample standard deviation over all points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StatisticalOutlier {
    /// Nearest others (published program: 20). 0 switches the filter off.
    #[schema(minimum = 0, maximum = 1000)]
    pub neighbours: u32,
    /// Sample standard deviations (published program: 4).
    #[schema(minimum = 0.0, maximum = 1000.0)]
    pub deviations: f64,
}

impl Default for StatisticalOutlier {
    fn default() -> Self {
        Self { neighbours: 20, deviations: 4.0 }
    }
}
