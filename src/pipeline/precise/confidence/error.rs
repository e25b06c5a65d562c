//! The expected error of a point, in mm.
//!
//! Each cause adds its variance. The factors were fitted once, by non-negative least squares
//! weighted by the variance itself, to the squared true error on forty-two phantoms with an analytic
//! skin that this software did not make (0.45 to 0.98 mm pixels, 0.6 to 3 mm slices, noise 1 to
//! 15 HU, edges of 0.3 to 0.9 mm, forty-two heads and poses, with a holder near the head or touching
//! it). They say how much of each cause ends up across the skin. `GAP`, `ARC` and `SHIFT` were set anew on
//! seven more with slices of 2 to 5 mm when the bend of the contours came in.

use super::agreement::Agreement;
use crate::geometry::{dot, norm};
use crate::pipeline::precise::border::between_slices;
use crate::pipeline::precise::border::crossing::Crossing;
use crate::pipeline::precise::scan::edge_spread::EdgeSpread;
use crate::pipeline::precise::scan::sampler::Sampler;

/// Always there, of the voxel's longest edge: what sampling leaves open.
const VOXEL: f64 = 0.0055;
/// Of the edge fit's own deviation (noise, width).
const EDGE: f64 = 0.29;
/// Of the deviation of an edge between two slices that do not resolve it.
const UNRESOLVED: f64 = 0.98;
/// Of the offset from the surface of the neighbours.
const OFFSET: f64 = 0.84;
/// Of the edge's variance (mm²) times the curvature (1/mm): a blurred edge moves toward the inside
/// of a bend.
const BEND: f64 = 1.59;
/// Curvature above this is not told from noise, 1/mm.
const MOST_CURVED: f64 = 0.3;
/// Of the way that the crossing would move with the scan's usual levels: where fat lies close below
/// the skin, or foam close above it, its own are less certain.
const LEVEL: f64 = 0.41;
/// Of the edge fit's deviation where there are no neighbours to agree.
const ALONE: f64 = 4.75;
/// Between slices: of gap^1.5.
const GAP: f64 = 0.0055;
/// Between slices: of gap² · curvature, the height of the arc over its chord.
const ARC: f64 = 0.060;
/// Between slices: of the edge's variance times the curvature.
const BEND_BETWEEN: f64 = 3.1;
/// Between slices: of the way that the contour moves from one to the next, in gaps, times gap^1.5.
const SHIFT: f64 = 0.0034;
/// Between slices: of the offset from the surface of the neighbours.
const OFFSET_BETWEEN: f64 = 1.14;
/// Between slices, where there are no neighbours to agree, mm.
const ALONE_BETWEEN_MM: f64 = 0.89;

/// What the scan's geometry and its sharpness lend to the error.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Confidence {
    voxel: f64,
    gap: f64,
    slice_axis: usize,
    width: EdgeSpread,
}

impl Confidence {
    /// For a scan.
    pub(crate) fn of(sampler: &Sampler, width: &EdgeSpread) -> Self {
        let slice_axis = sampler.slice_axis();
        Self {
            voxel: (0..3).map(|a| norm(sampler.mean_step(a))).fold(0.0, f64::max),
            gap: dot(sampler.mean_step(slice_axis), sampler.slice_normal()).abs(),
            slice_axis,
            width: *width,
        }
    }

    /// Expected error of a point along its normal, mm.
    pub(crate) fn error(&self, c: &Crossing, a: &Agreement) -> f64 {
        let bend = a.curvature.abs().min(MOST_CURVED);
        let moved = self.width.along(c.normal).powi(2) * bend;
        let parts = if c.between {
            [
                OFFSET_BETWEEN * a.offset,
                BEND_BETWEEN * moved,
                GAP * self.gap.powf(1.5),
                ARC * self.gap * self.gap * bend,
                // There the coarseness is in gaps.
                SHIFT * c.coarseness * self.gap.powf(1.5),
                if a.is_known() { 0.0 } else { ALONE_BETWEEN_MM },
            ]
        } else {
            let unresolved =
                usize::from(c.axis) == self.slice_axis && c.coarseness >= between_slices::UNRESOLVED;
            let (edge, alone) = if unresolved { (UNRESOLVED, 0.0) } else { (EDGE, ALONE) };
            [
                OFFSET * a.offset,
                BEND * moved,
                VOXEL * self.voxel,
                LEVEL * c.level,
                edge * c.error,
                if a.is_known() { 0.0 } else { alone * c.error },
            ]
        };
        parts.iter().map(|p| p * p).sum::<f64>().sqrt()
    }
}
