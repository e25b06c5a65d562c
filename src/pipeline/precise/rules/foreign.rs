//! `foreign`: the border is not the patient's but that of what touches the patient: a couch, a holder, a mask,
//! a strap.
//!
//! It is asked before the field of view: a couch wider than that is not the patient's missing skin.

use crate::pipeline::precise::border::sighting::{DEEPEST_CELLS, Refusal, Sighting};
use crate::pipeline::precise::labels::Labels;
use crate::pipeline::precise::labels::label::Label;
use crate::pipeline::precise::reason::StretchReason;
use crate::pipeline::precise::scan::Scan;

/// Refuses a border behind which the survey shows anything but the patient; measured is how far behind it,
/// mm.
pub(crate) fn test(_: &Scan<'_>, labels: &Labels, at: &Sighting) -> Option<Refusal> {
    let (label, measured) = at.behind;
    let limit = DEEPEST_CELLS * labels.patient.survey.cells.edge;
    (label != Label::Patient).then_some(Refusal { reason: StretchReason::Foreign, measured, limit })
}
