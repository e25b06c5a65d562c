//! The expected error of a point, in mm.
//!
//! Each cause adds its variance. The factors were fitted once, by non-negative least squares
//! weighted by the variance itself, to the squared true error on eleven phantoms with an analytic
//! skin that this software did not make (0.45 to 0.98 mm pixels, 0.6 to 3 mm slices, noise 5 to
//! 15 HU, eleven heads and poses, with a holder near the head or touching it). They say how much of
//! each cause ends up across the skin.

use super::agreement::Agreement;
use super::between;
use super::crossings::Crossing;
use super::space::Space;
use crate::geometry::{dot, norm};

/// Always there, mm.
const LEAST_MM: f64 = 0.007;
/// Of the pixel's edge: what sampling leaves open.
const PIXEL: f64 = 0.0178;
/// Of the edge fit's own deviation (noise, width).
const EDGE: f64 = 0.308;
/// Of the deviation of an edge between two slices that do not resolve it.
const UNRESOLVED: f64 = 0.85;
/// Of the offset from the surface of the neighbours.
const OFFSET: f64 = 1.12;
/// mm of error for a curvature of 1/mm: a blurred edge moves toward the inside of a bend.
const CURVATURE: f64 = 0.75;
/// Curvature above this is not told from noise, 1/mm.
const MOST_CURVED: f64 = 0.3;
/// Of the edge fit's deviation where there are no neighbours to agree.
const ALONE: f64 = 8.0;
/// Between slices: of the gap.
const GAP: f64 = 0.0085;
/// Between slices: of gap² · curvature, the height of the arc over its chord.
const ARC: f64 = 0.111;
/// Between slices: of the way that the contour moves from one to the next.
const SHIFT: f64 = 0.0121;
/// Between slices: of the offset from the surface of the neighbours.
const OFFSET_BETWEEN: f64 = 1.64;
/// Between slices, where there are no neighbours to agree, mm.
const ALONE_BETWEEN_MM: f64 = 0.9;

/// What the scan's geometry lends to the error.
#[derive(Debug, Clone, Copy)]
pub(super) struct Confidence {
    pixel: f64,
    gap: f64,
    slice_axis: usize,
}

impl Confidence {
    /// For a scan.
    pub(super) fn of(space: &Space) -> Self {
        let slice_axis = space.slice_axis();
        let in_plane = (0..3).filter(|&a| a != slice_axis).map(|a| norm(space.mean_step(a)));
        Self {
            pixel: in_plane.fold(0.0, f64::max),
            gap: dot(space.mean_step(slice_axis), space.slice_normal()).abs(),
            slice_axis,
        }
    }

    /// Expected error of a point along its normal, mm.
    pub(super) fn error(&self, c: &Crossing, a: &Agreement) -> f64 {
        let bend = a.curvature.abs().min(MOST_CURVED);
        let parts = if c.between {
            [
                OFFSET_BETWEEN * a.offset,
                CURVATURE * bend,
                GAP * self.gap,
                ARC * self.gap * self.gap * bend,
                // There the coarseness is in gaps.
                SHIFT * c.coarseness * self.gap,
                if a.is_known() { 0.0 } else { ALONE_BETWEEN_MM },
            ]
        } else {
            let unresolved = usize::from(c.axis) == self.slice_axis && c.coarseness >= between::UNRESOLVED;
            let (edge, alone) = if unresolved { (UNRESOLVED, 0.0) } else { (EDGE, ALONE) };
            [
                OFFSET * a.offset,
                CURVATURE * bend,
                LEAST_MM,
                PIXEL * self.pixel,
                edge * c.error,
                if a.is_known() { 0.0 } else { alone * c.error },
            ]
        };
        parts.iter().map(|p| p * p).sum::<f64>().sqrt()
    }
}
