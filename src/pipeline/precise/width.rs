//! How wide the scan shows an edge: the standard deviation of its point spread, in the plane of
//! the slices and across them.

use super::candidates::Candidate;
use super::regions::Regions;
use super::space::Space;
use crate::geometry::{Vec3, dot, norm};

/// Standard deviations in mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Width {
    /// In the plane of the slices.
    pub(super) in_plane: f64,
    /// Across the slices.
    pub(super) across: f64,
}

/// The part of the way from air to tissue that is counted; above it the next layer (fat) begins.
const COUNTED: [f64; 2] = [0.06, 0.80];
/// Its width in standard deviations.
const SPAN: f64 = 0.841_621 + 1.554_774;

impl Width {
    /// From the share of voxels that lie on the slope of the edge: however wide the voxels are,
    /// the mean length of that slope is the same.
    pub(super) fn of(space: &Space, candidates: &[Candidate], regions: &Regions) -> Self {
        let mut sums = [[0.0; 2]; 2];
        for (i, c) in candidates.iter().enumerate() {
            let axis = usize::from(c.axis);
            let step = space.mean_step(axis);
            let cosine = dot(c.normal, step).abs() / norm(step);
            if cosine < 0.9 {
                continue;
            }
            let (tissue, air) = regions.levels(i);
            let length = dot(c.normal, space.step_at(axis, usize::from(c.inner[axis]))).abs();
            let on_slope = super::crossings::profile(space, c)
                .iter()
                .map(|v| f64::from(v - air) / f64::from(tissue - air))
                .filter(|share| (COUNTED[0]..COUNTED[1]).contains(share))
                .count();
            let sum = &mut sums[usize::from(axis == space.slice_axis())];
            {
                sum[0] += length * on_slope as f64;
            }
            sum[1] += 1.0;
        }
        let mean = |[sum, n]: [f64; 2], least: f64| (n > 100.0).then(|| (sum / n / SPAN).max(least));
        let in_plane = mean(sums[0], 0.2).unwrap_or(0.6);
        Self { in_plane, across: mean(sums[1], 0.2).unwrap_or(in_plane) }
    }

    /// Along a direction, as trilinear samples show it: they widen the edge once more.
    #[inline]
    pub(super) fn seen_along(&self, space: &Space, n: Vec3) -> f64 {
        let widened: f64 = (0..3).map(|axis| dot(n, space.mean_step(axis)).powi(2) / 6.0).sum();
        (self.along(n, space.slice_normal()).powi(2) + widened).sqrt()
    }

    /// Along a direction.
    #[inline]
    pub(super) fn along(&self, n: Vec3, slice_normal: Vec3) -> f64 {
        let s = dot(n, slice_normal).powi(2);
        (self.in_plane.powi(2) * (1.0 - s) + self.across.powi(2) * s).sqrt()
    }
}
