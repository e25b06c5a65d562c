//! Unique points between two clouds (paper, section 3.2).

use serde::Serialize;

use crate::geometry::Vec3;
use crate::pipeline::neighbours::unique::unique;

/// The paper's radius, mm.
pub(super) const DISTANCE_MM: f32 = 1.0;

/// Points of a cloud that no point of another is nearer to than 1 mm.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unique {
    /// The tolerance, mm.
    pub distance_mm: f32,
    /// How many.
    pub points: usize,
    /// Their share of the cloud, 0 to 1.
    pub share: f64,
}

impl Unique {
    /// Of `cloud` against `other`.
    #[must_use]
    pub fn new(cloud: &[Vec3], other: &[Vec3]) -> Self {
        let (cloud, other) = (single(cloud), single(other));
        let points = unique(&cloud, &other, DISTANCE_MM).iter().filter(|unique| **unique).count();
        Self { distance_mm: DISTANCE_MM, points, share: points as f64 / cloud.len().max(1) as f64 }
    }
}

/// Single precision, as clouds are stored and as the pipeline counts.
#[expect(clippy::cast_possible_truncation, reason = "coordinates of a cloud are single precision")]
fn single(points: &[Vec3]) -> Vec<[f32; 3]> {
    points.iter().map(|p| p.map(|c| c as f32)).collect()
}
