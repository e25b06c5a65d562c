//! The skin between two thick slices.
//!
//! Where slices lie further apart than a leaf, the sagittal and coronal images hold nothing but
//! interpolation there. Interpolated HU would make steps of a slanting skin; interpolated distance
//! to the measured contour (shape-based interpolation, Raya and Udupa 1990) does not: where the
//! weighted distances to the contours of the two slices cancel, there is skin.

use rayon::prelude::*;

use super::crossing::Crossing;
use super::rejected::Rejected;
use super::split::parted;
use crate::geometry::dot;
use crate::pipeline::precise::reason::StretchReason;
use crate::pipeline::precise::scan::sampler::Sampler;
pub(crate) mod contours;

use contours::Contours;

/// Slices nearer than this need no help, mm.
const NEAR_MM: f64 = 1.25;
/// A line across the slices that has fewer voxels than this for the edge (in standard deviations
/// from one to the next) does not resolve it.
pub(crate) const UNRESOLVED: f64 = 2.0;
/// Skin that only one of two slices shows is not accepted where its expected error along the normal
/// is larger than this, mm.
const DOUBTFUL_MM: f64 = 1.0;

/// What the slices tell of the skin between them.
pub(crate) struct BetweenSlices {
    /// From each slice to the next, mm.
    gaps: Vec<f64>,
    contours: Contours,
}

impl BetweenSlices {
    /// `None` where the slices lie so close that they need no help.
    pub(crate) fn of(sampler: &Sampler, crossings: &[Crossing]) -> Option<Self> {
        let gaps = sampler.gaps();
        if gaps.iter().all(|&g| g < NEAR_MM) {
            return None;
        }
        let contours = Contours::of(sampler, &gaps, crossings)?;
        Some(Self { gaps, contours })
    }

    /// Puts what only one slice shows where the contours have it, and takes out what nobody can place:
    /// it lies anywhere up to the other slice.
    pub(crate) fn settle(&self, sampler: &Sampler, crossings: &mut Vec<Crossing>) -> Vec<Rejected> {
        let settled = crossings.par_iter().map(|c| self.settled(sampler, c));
        let (settled, doubtful) = parted(sampler.asked(), settled);
        *crossings = settled;
        doubtful
    }

    fn settled(&self, sampler: &Sampler, c: &Crossing) -> Result<Crossing, Rejected> {
        sampler.ask();
        if !unresolved(sampler, c) || self.contours.knows(sampler, c.place) {
            return Ok(*c);
        }
        let alone = Crossing { error: self.error(sampler, c), ..*c };
        let best = self.contours.cap(sampler, c).filter(|cap| cap.error < alone.error).unwrap_or(alone);
        if best.error <= DOUBTFUL_MM {
            return Ok(best);
        }
        Err(Rejected {
            place: c.place,
            normal: c.normal,
            axis: c.axis,
            inner: sampler.index(c.place).rounded(),
            reason: StretchReason::Unresolved,
            measured: best.error,
            limit: DOUBTFUL_MM,
        })
    }

    /// Adds the skin between slices that lie far apart, and drops what the lines across them do not
    /// resolve where the contours know better.
    pub(crate) fn fill(&self, sampler: &Sampler, crossings: &[Crossing]) -> Vec<Crossing> {
        let made: Vec<Vec<Crossing>> = self
            .gaps
            .par_iter()
            .enumerate()
            .panic_fuse()
            .map(|(k, &gap)| if gap < NEAR_MM { Vec::new() } else { self.contours.between(sampler, k) })
            .collect();
        let seen = crossings.iter().enumerate().filter(|(i, c)| {
            sampler.ask_at(*i);
            !unresolved(sampler, c) || !self.contours.knows(sampler, c.place)
        });
        let mut filled: Vec<Crossing> = seen.map(|(_, c)| *c).collect();
        for made in made {
            sampler.ask();
            filled.extend(made);
        }
        filled
    }

    /// The standard deviation along the normal of what lies anywhere between two slices, mm.
    fn error(&self, sampler: &Sampler, c: &Crossing) -> f64 {
        let k = sampler.index(c.place)[sampler.slice_axis()].max(0.0) as usize;
        self.gaps[k.min(self.gaps.len() - 1)] / 12f64.sqrt() * dot(c.normal, sampler.slice_normal()).abs()
    }
}

/// Whether a crossing lies on a line across the slices that does not resolve the edge.
fn unresolved(sampler: &Sampler, c: &Crossing) -> bool {
    usize::from(c.axis) == sampler.slice_axis() && c.coarseness >= UNRESOLVED
}
