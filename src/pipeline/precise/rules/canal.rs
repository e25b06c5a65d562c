//! `canal`: the rim of a nostril, an ear canal or the mouth; behind it is inside.

use crate::pipeline::precise::border::sighting::{Refusal, Sighting};
use crate::pipeline::precise::labels::Labels;
use crate::pipeline::precise::labels::outside::Beyond;
use crate::pipeline::precise::reason::StretchReason;
use crate::pipeline::precise::scan::Scan;

/// Refuses what borders on a canal; measured is how far before the border it lies, mm.
pub(crate) fn test(_: &Scan<'_>, labels: &Labels, at: &Sighting) -> Option<Refusal> {
    let Beyond::Canal(measured) = at.beyond else { return None };
    Some(Refusal { reason: StretchReason::Canal, measured, limit: labels.outside.reach_mm() })
}
