//! How wide the scan shows an edge: the standard deviation of its point spread along each axis of the
//! volume. Which of them the slices were cut across does not matter.

use super::candidates::Candidate;
use super::edge::probit;
use super::levels::Levels;
use super::regions::Regions;
use super::space::Space;
use crate::geometry::{Vec3, dot, norm};

/// Standard deviations in mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Width {
    /// Along `[z, y, x]`, the slices' normal in place of a sheared axis.
    along: [f64; 3],
    units: [Vec3; 3],
    slice_axis: usize,
}

/// The part of the way from air to tissue that is counted; above it the next layer (fat) begins.
const COUNTED: [f64; 2] = [0.06, 0.80];
/// No edge is narrower, mm.
const LEAST_MM: f64 = 0.2;
/// No slope goes further from its middle, mm.
const FURTHEST_MM: f64 = 3.0;
/// Where no line tells, mm.
const USUAL_MM: f64 = 0.6;

impl Width {
    /// From the share of voxels that lie on the slope of the edge: however wide the voxels are,
    /// the mean length of that slope is the same.
    pub(super) fn of(space: &Space, levels: &Levels, candidates: &[Candidate], regions: &Regions) -> Self {
        let mut sums = [[0.0; 2]; 3];
        for (i, c) in candidates.iter().enumerate() {
            space.ask_at(i);
            let axis = usize::from(c.axis);
            let step = space.mean_step(axis);
            let cosine = dot(c.normal, step).abs() / norm(step);
            if cosine < 0.9 {
                continue;
            }
            let (tissue, air) = regions.levels(i);
            let length = dot(c.normal, space.step_at(axis, usize::from(c.inner[axis]))).abs();
            let lowest = levels.least_share(tissue, air).map_or(COUNTED[0], |least| least.max(COUNTED[0]));
            let counted = [lowest, COUNTED[1]];
            let Some(on_slope) = voxels_on_slope(space, c, length, [tissue, air], counted) else { continue };
            sums[axis][0] += length * on_slope as f64 / (probit(counted[1]) - probit(counted[0]));
            sums[axis][1] += 1.0;
        }
        let mean = |[sum, n]: [f64; 2]| (n > 100.0).then(|| (sum / n).max(LEAST_MM));
        let found = sums.map(mean);
        let usual = found.iter().flatten().copied().reduce(f64::min).unwrap_or(USUAL_MM);
        Self {
            along: found.map(|w| w.unwrap_or(usual)),
            units: space.units(),
            slice_axis: space.slice_axis(),
        }
    }

    /// In the plane of the slices.
    pub(super) fn in_plane(&self) -> f64 {
        let squares = (0..3).filter(|&a| a != self.slice_axis).map(|a| self.along[a].powi(2));
        (squares.sum::<f64>() / 2.0).sqrt()
    }

    /// Across the slices.
    pub(super) fn across(&self) -> f64 {
        self.along[self.slice_axis]
    }

    /// Along a direction, as trilinear samples show it: they widen the edge once more.
    #[inline]
    pub(super) fn seen_along(&self, space: &Space, n: Vec3) -> f64 {
        let widened: f64 = (0..3).map(|axis| dot(n, space.mean_step(axis)).powi(2) / 6.0).sum();
        (self.along(n).powi(2) + widened).sqrt()
    }

    /// Along a direction.
    #[inline]
    pub(super) fn along(&self, n: Vec3) -> f64 {
        (0..3).map(|a| (self.along[a] * dot(n, self.units[a])).powi(2)).sum::<f64>().sqrt()
    }
}

/// How many voxels of a candidate's line, each so many mm deep, lie on the slope of its edge; `None`
/// where the slope does not end in air, but at a mask, say.
fn voxels_on_slope(
    space: &Space,
    c: &Candidate,
    depth: f64,
    [tissue, air]: [f32; 2],
    counted: [f64; 2],
) -> Option<usize> {
    let axis = usize::from(c.axis);
    let inner = c.inner.map(usize::from);
    let reach = (FURTHEST_MM / depth) as isize;
    let share = |outward: isize| {
        let mut at = inner;
        at[axis] = inner[axis].checked_add_signed(if c.ascending { outward } else { -outward })?;
        let v = (at[axis] < space.shape[axis]).then(|| space.voxel(at))?;
        Some(f64::from(v - air) / f64::from(tissue - air))
    };
    let outside = (1..=reach).map_while(share).position(|s| s < counted[0])?;
    let inside = (0..reach).map_while(|n| share(-n)).take_while(|&s| s < counted[1]);
    Some(outside + inside.count())
}
