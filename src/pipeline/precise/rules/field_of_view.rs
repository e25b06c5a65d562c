//! `field_of_view`: the image or its field of view ends here.

use crate::pipeline::precise::border::sighting::{Refusal, Sighting};
use crate::pipeline::precise::labels::Labels;
use crate::pipeline::precise::reason::StretchReason;
use crate::pipeline::precise::scan::Scan;
use crate::pipeline::precise::scan::field_of_view::RIM;

/// Refuses a border so near the end of the field of view that nobody can tell the two apart; measured is
/// how far away it is, mm.
pub(crate) fn test(scan: &Scan<'_>, _: &Labels, at: &Sighting) -> Option<Refusal> {
    let voxels = at.field_ends?;
    let pixel = scan.sampler.largest_pixel();
    Some(Refusal {
        reason: StretchReason::FieldOfView,
        measured: voxels as f64 * pixel,
        limit: RIM as f64 * pixel,
    })
}
