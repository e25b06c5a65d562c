//! How wide the scan shows an edge, measured at the candidates.

use super::candidate::Candidate;
use super::edge_fit::probit;
use super::local_levels::{AtSkin, LocalLevels};
use crate::geometry::{dot, norm};
use crate::pipeline::precise::grid::index::Voxel;
use crate::pipeline::precise::scan::edge_spread::EdgeSpread;
use crate::pipeline::precise::scan::levels::Levels;
use crate::pipeline::precise::scan::sampler::Sampler;

/// The part of the way from air to tissue that is counted; above it the next layer (fat) begins.
const COUNTED: [f64; 2] = [0.06, 0.80];
/// No edge is narrower, mm.
const LEAST_MM: f64 = 0.2;
/// No slope goes further from its middle, mm.
const FURTHEST_MM: f64 = 3.0;
/// Where no line tells, mm.
const USUAL_MM: f64 = 0.6;

/// From the share of voxels that lie on the slope of the edge: however wide the voxels are,
/// the mean length of that slope is the same.
pub(crate) fn measure(
    sampler: &Sampler,
    levels: &Levels,
    candidates: &[Candidate],
    local: &LocalLevels,
) -> EdgeSpread {
    let mut sums = [[0.0; 2]; 3];
    for (i, c) in candidates.iter().enumerate() {
        sampler.ask_at(i);
        let axis = usize::from(c.axis);
        let step = sampler.mean_step(axis);
        let cosine = dot(c.normal, step).abs() / norm(step);
        if cosine < 0.9 {
            continue;
        }
        let AtSkin { tissue, air } = local.at(i);
        let length = dot(c.normal, sampler.step_at(axis, usize::from(c.inner[axis]))).abs();
        let lowest = levels.least_share(tissue, air).map_or(COUNTED[0], |least| least.max(COUNTED[0]));
        let counted = [lowest, COUNTED[1]];
        let Some(on_slope) = voxels_on_slope(sampler, c, length, [tissue, air], counted) else { continue };
        sums[axis][0] += length * on_slope as f64 / (probit(counted[1]) - probit(counted[0]));
        sums[axis][1] += 1.0;
    }
    let mean = |[sum, n]: [f64; 2]| (n > 100.0).then(|| (sum / n).max(LEAST_MM));
    let found = sums.map(mean);
    let usual = found.iter().flatten().copied().reduce(f64::min).unwrap_or(USUAL_MM);
    EdgeSpread {
        along: found.map(|w| w.unwrap_or(usual)),
        units: sampler.units(),
        slice_axis: sampler.slice_axis(),
    }
}

/// How many voxels of a candidate's line, each so many mm deep, lie on the slope of its edge; `None`
/// where the slope does not end in air, but at a mask, say.
fn voxels_on_slope(
    sampler: &Sampler,
    c: &Candidate,
    depth: f64,
    [tissue, air]: [f32; 2],
    counted: [f64; 2],
) -> Option<usize> {
    let axis = usize::from(c.axis);
    let inner = Voxel(c.inner.map(usize::from));
    let reach = (FURTHEST_MM / depth) as isize;
    let share = |outward: isize| {
        let mut at = inner;
        at[axis] = inner[axis].checked_add_signed(if c.ascending { outward } else { -outward })?;
        let v = (at[axis] < sampler.shape[axis]).then(|| sampler.voxel(at))?;
        Some(f64::from(v - air) / f64::from(tissue - air))
    };
    let outside = (1..=reach).map_while(share).position(|s| s < counted[0])?;
    let inside = (0..reach).map_while(|n| share(-n)).take_while(|&s| s < counted[1]);
    Some(outside + inside.count())
}
