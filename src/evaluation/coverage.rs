//! How much of the truth has a point of the cloud nearby.

use serde::Serialize;

use super::target::{Nearest, Target};

/// Shares of a target's points (of a mesh: of its area) with a point of the cloud nearby.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Coverage {
    /// How many points of the target were looked at.
    pub points: usize,
    /// How far apart they are, mm, where they are spread over a mesh; `null` for a cloud's own.
    pub spacing_mm: Option<f64>,
    /// Share with a point within 1 mm, 0 to 1.
    pub within_1_mm: f64,
    /// Share with a point within 1.5 mm, 0 to 1.
    pub within_1_5_mm: f64,
}

impl Coverage {
    /// Of `target` by the points of `cloud`.
    #[must_use]
    pub fn new(target: &Target, cloud: &Target) -> Self {
        let (samples, spacing_mm) = target.samples();
        let nearest = cloud.nearest(&samples, &[]);
        let share = |limit: f64| within(&nearest, limit) as f64 / samples.len().max(1) as f64;
        Self { points: samples.len(), spacing_mm, within_1_mm: share(1.0), within_1_5_mm: share(1.5) }
    }
}

fn within(nearest: &[Nearest], limit: f64) -> usize {
    nearest.iter().filter(|nearest| nearest.distance <= limit).count()
}
