//! The border of the patient as it lies in the slices, for pictures.

use rayon::prelude::*;

use crate::geometry::Vec3;
use crate::pipeline::precise::border::crossing::Crossing;
use crate::pipeline::precise::border::rejected::Rejected;
use crate::pipeline::precise::reason::StretchReason;
use crate::pipeline::precise::scan::sampler::Sampler;

/// A place where a grid line crosses the border of the patient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BorderPoint {
    /// Fractional voxel index `[z, y, x]`: whole along the two axes that the line does not follow.
    pub index: [f32; 3],
    /// The array axis that the line follows: 0 z, 1 y, 2 x. The point lies in the slices of the
    /// two planes at right angles to the others.
    pub axis: u8,
    /// Why it was not accepted as skin; `None` for an accepted one.
    pub reason: Option<StretchReason>,
}

/// The crossings as they lie in the slices.
pub(crate) fn border_points(
    sampler: &Sampler,
    accepted: &[Crossing],
    rejected: &[Rejected],
) -> Vec<BorderPoint> {
    let point = |place: Vec3, axis: u8, reason| {
        sampler.ask();
        let mut index = sampler.index(place).0;
        for (a, v) in index.iter_mut().enumerate().filter(|(a, _)| *a != usize::from(axis)) {
            debug_assert!((*v - v.round()).abs() < 1e-3, "a line follows one axis, not {a}");
            *v = v.round();
        }
        BorderPoint { index: index.map(|v| v as f32), axis, reason }
    };
    let of_accepted = accepted.par_iter().panic_fuse().map(|c| point(c.place, c.axis, None));
    of_accepted
        .chain(rejected.par_iter().panic_fuse().map(|d| point(d.place, d.axis, Some(d.reason))))
        .collect()
}
