//! How wide the scan shows an edge: the standard deviation of its point spread along each axis of the
//! volume. Which of them the slices were cut across does not matter.

use super::sampler::Sampler;
use crate::geometry::{Vec3, dot};

/// Standard deviations in mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EdgeSpread {
    /// Along `[z, y, x]`, the slices' normal in place of a sheared axis.
    pub(crate) along: [f64; 3],
    /// Unit vectors along these axes.
    pub(crate) units: [Vec3; 3],
    /// Which of them the slices lie across.
    pub(crate) slice_axis: usize,
}

impl EdgeSpread {
    /// In the plane of the slices.
    pub(crate) fn in_plane(&self) -> f64 {
        let squares = (0..3).filter(|&a| a != self.slice_axis).map(|a| self.along[a].powi(2));
        (squares.sum::<f64>() / 2.0).sqrt()
    }

    /// Across the slices.
    pub(crate) fn across(&self) -> f64 {
        self.along[self.slice_axis]
    }

    /// Along a direction, as trilinear samples show it: they widen the edge once more.
    #[inline]
    pub(crate) fn seen_along(&self, sampler: &Sampler, n: Vec3) -> f64 {
        let widened: f64 = (0..3).map(|axis| dot(n, sampler.mean_step(axis)).powi(2) / 6.0).sum();
        (self.along(n).powi(2) + widened).sqrt()
    }

    /// Along a direction.
    #[inline]
    pub(crate) fn along(&self, n: Vec3) -> f64 {
        (0..3).map(|a| (self.along[a] * dot(n, self.units[a])).powi(2)).sum::<f64>().sqrt()
    }
}
