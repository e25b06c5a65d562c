//! The skin between two thick slices.
//!
//! Where slices lie further apart than a leaf, the sagittal and coronal images hold nothing but
//! interpolation there. Interpolated HU would make steps of a slanting skin; interpolated distance
//! to the measured contour (shape-based interpolation, Raya and Udupa 1990) does not: where the
//! weighted distances to the contours of the two slices cancel, there is skin.

use rayon::prelude::*;

use super::candidates::Doubtful;
use super::contours::Contours;
use super::crossings::Crossing;
use super::parted::parted;
use super::space::Space;
use super::stretches::StretchReason;
use crate::geometry::dot;

/// Slices nearer than this need no help, mm.
const NEAR_MM: f64 = 1.25;
/// A line across the slices that has fewer voxels than this for the edge (in standard deviations
/// from one to the next) does not resolve it.
pub(super) const UNRESOLVED: f64 = 2.0;
/// Skin that only one of two slices shows is not accepted where its expected error along the normal
/// is larger than this, mm.
const DOUBTFUL_MM: f64 = 1.0;

/// What the slices tell of the skin between them.
pub(super) struct Between {
    /// From each slice to the next, mm.
    gaps: Vec<f64>,
    contours: Contours,
}

impl Between {
    /// `None` where the slices lie so close that they need no help.
    pub(super) fn of(space: &Space, crossings: &[Crossing]) -> Option<Self> {
        let gaps = space.gaps();
        if gaps.iter().all(|&g| g < NEAR_MM) {
            return None;
        }
        let contours = Contours::of(space, &gaps, crossings)?;
        Some(Self { gaps, contours })
    }

    /// Puts what only one slice shows where the contours have it, and takes out what nobody can place:
    /// it lies anywhere up to the other slice.
    pub(super) fn settle(&self, space: &Space, crossings: &mut Vec<Crossing>) -> Vec<Doubtful> {
        let (settled, doubtful) = parted(space.asked(), crossings.par_iter().map(|c| self.settled(space, c)));
        *crossings = settled;
        doubtful
    }

    fn settled(&self, space: &Space, c: &Crossing) -> Result<Crossing, Doubtful> {
        space.ask();
        if !unresolved(space, c) || self.contours.knows(space, c.place) {
            return Ok(*c);
        }
        let alone = Crossing { error: self.error(space, c), ..*c };
        let best = self.contours.cap(space, c).filter(|cap| cap.error < alone.error).unwrap_or(alone);
        if best.error <= DOUBTFUL_MM {
            return Ok(best);
        }
        Err(Doubtful {
            place: c.place,
            normal: c.normal,
            axis: c.axis,
            inner: space.index(c.place).map(|v| v.round() as u16),
            reason: StretchReason::Unresolved,
            measured: best.error,
            limit: DOUBTFUL_MM,
        })
    }

    /// Adds the skin between slices that lie far apart, and drops what the lines across them do not
    /// resolve where the contours know better.
    pub(super) fn fill(&self, space: &Space, crossings: &[Crossing]) -> Vec<Crossing> {
        let made: Vec<Vec<Crossing>> = self
            .gaps
            .par_iter()
            .enumerate()
            .panic_fuse()
            .map(|(k, &gap)| if gap < NEAR_MM { Vec::new() } else { self.contours.between(space, k) })
            .collect();
        let seen = crossings.iter().enumerate().filter(|(i, c)| {
            space.ask_at(*i);
            !unresolved(space, c) || !self.contours.knows(space, c.place)
        });
        let mut filled: Vec<Crossing> = seen.map(|(_, c)| *c).collect();
        for made in made {
            space.ask();
            filled.extend(made);
        }
        filled
    }

    /// The standard deviation along the normal of what lies anywhere between two slices, mm.
    fn error(&self, space: &Space, c: &Crossing) -> f64 {
        let k = space.index(c.place)[space.slice_axis()].max(0.0) as usize;
        self.gaps[k.min(self.gaps.len() - 1)] / 12f64.sqrt() * dot(c.normal, space.slice_normal()).abs()
    }
}

/// Whether a crossing lies on a line across the slices that does not resolve the edge.
fn unresolved(space: &Space, c: &Crossing) -> bool {
    usize::from(c.axis) == space.slice_axis() && c.coarseness >= UNRESOLVED
}
