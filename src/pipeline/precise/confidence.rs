//! The expected error of a point, in mm.
//!
//! Each cause adds its variance. The factors were fitted once, by non-negative least squares, to
//! the true error on phantoms with an analytic skin (0.45 to 0.98 mm pixels, 0.6 to 3 mm slices,
//! noise 3 to 15 HU, several heads and poses); they say how much of each cause ends up across the
//! skin.

use super::agreement::Agreement;
use super::crossings::Crossing;
use super::space::Space;
use crate::geometry::{dot, norm};

/// Of the edge fit's own deviation (noise, width).
const EDGE: f64 = 0.42;
/// Of the pixel's edge.
const PIXEL: f64 = 0.015;
/// Of the offset from the surface of the neighbours.
const OFFSET: f64 = 1.07;
/// Of the neighbours' scatter.
const SCATTER: f64 = 0.093;
/// mm of error for a curvature of 1/mm: a blurred edge moves toward the inside of a bend.
const CURVATURE: f64 = 0.60;
/// Curvature above this is not told from noise, 1/mm.
const MOST_CURVED: f64 = 0.3;
/// Of the edge fit's deviation where there are no neighbours to agree.
const ALONE: f64 = 2.0;
/// Between slices: of the gap.
const GAP: f64 = 0.013;
/// Between slices: of gap² · curvature, the height of the arc over its chord.
const ARC: f64 = 0.104;
/// Between slices: of the neighbours' scatter.
const SCATTER_BETWEEN: f64 = 0.116;

/// What the scan's geometry lends to the error.
#[derive(Debug, Clone, Copy)]
pub(super) struct Confidence {
    pixel: f64,
    gap: f64,
}

impl Confidence {
    /// For a scan.
    pub(super) fn of(space: &Space) -> Self {
        let s = space.slice_axis();
        let in_plane = (0..3).filter(|&a| a != s).map(|a| norm(space.mean_step(a)));
        Self { pixel: in_plane.fold(0.0, f64::max), gap: dot(space.mean_step(s), space.slice_normal()).abs() }
    }

    /// Expected error of a point along its normal, mm.
    pub(super) fn error(&self, c: &Crossing, a: &Agreement) -> f64 {
        let bend = a.curvature.abs().min(MOST_CURVED);
        let mut parts = vec![PIXEL * self.pixel, OFFSET * a.offset, CURVATURE * bend];
        if c.between {
            parts.extend([GAP * self.gap, ARC * self.gap * self.gap * bend, SCATTER_BETWEEN * a.scatter]);
        } else {
            parts.extend([EDGE * c.error, SCATTER * a.scatter]);
        }
        if !a.is_known() {
            parts.push(ALONE * c.error);
        }
        parts.iter().map(|p| p * p).sum::<f64>().sqrt()
    }
}
