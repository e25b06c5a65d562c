//! `unresolved`: a layer that is no clear tissue lies on the skin: a bandage, a gel, thick hair.

use crate::geometry::{add, scale};
use crate::pipeline::precise::border::sighting::{Refusal, Sighting};
use crate::pipeline::precise::labels::Labels;
use crate::pipeline::precise::labels::label::Label;
use crate::pipeline::precise::labels::patient::{CLEAR_MM, Patient};
use crate::pipeline::precise::reason::StretchReason;
use crate::pipeline::precise::scan::Scan;

/// Refuses a border too far before clear tissue; measured is how far, mm.
pub(crate) fn test(_: &Scan<'_>, _: &Labels, at: &Sighting) -> Option<Refusal> {
    (at.clear_mm > CLEAR_MM).then_some(Refusal {
        reason: StretchReason::Unresolved,
        measured: at.clear_mm,
        limit: CLEAR_MM,
    })
}

/// The same where the survey shows nothing but air right behind the border, and the patient further in.
pub(crate) fn under_a_layer(scan: &Scan<'_>, labels: &Labels, at: &Sighting) -> Option<Refusal> {
    let is_air = at.behind.0 == Label::Air;
    let refusal = test(scan, labels, at).filter(|_| is_air)?;
    is_patient(&labels.patient, at).then_some(refusal)
}

/// Whether the survey shows the patient where its clear tissue begins, or a cell further in.
fn is_patient(patient: &Patient, at: &Sighting) -> bool {
    let cells = &patient.survey.cells;
    let depths = [at.clear_mm, at.clear_mm + cells.edge].into_iter();
    let cell_at = |d: f64| cells.at(add(at.place, scale(at.normal, -d)));
    let mut found = depths.filter_map(cell_at).map(|cell| cells.offset(cell));
    found.any(|cell| patient.labels[cell] == Label::Patient)
}
