//! `touching`: something foreign touches the skin right beside.

use crate::geometry::{Vec3, dot, norm, sub};
use crate::pipeline::precise::border::sighting::{Refusal, Sighting};
use crate::pipeline::precise::labels::Labels;
use crate::pipeline::precise::labels::label::Label;
use crate::pipeline::precise::labels::patient::Patient;
use crate::pipeline::precise::reason::StretchReason;
use crate::pipeline::precise::scan::Scan;

/// What touches the patient puts the skin so near beside it in doubt, and what is higher against the
/// skin than this does not touch it there, mm.
pub(crate) const BESIDE_MM: (f64, f64) = (2.5, 1.0);
/// The same where something covers the skin, mm.
const COVERED_MM: (f64, f64) = (1.5, -0.5);
/// What is higher above the skin than this, and no further aside, covers it, mm.
const COVER_MM: (f64, f64) = (1.0, 1.0);
/// The furthest of these in cells of 1 mm, the smallest.
const BESIDE_CELLS: usize = 3;
/// Refuses what lies beside something foreign; measured is how far beside it, mm.
pub(crate) fn test(_: &Scan<'_>, labels: &Labels, at: &Sighting) -> Option<Refusal> {
    let measured = beside(&labels.patient, at.place, at.normal)?;
    Some(Refusal { reason: StretchReason::Touching, measured, limit: BESIDE_MM.0 })
}

/// How far beside the border the nearest cell is that is not the patient's, if it is so near that
/// it puts the border in doubt. Where something lies over it, as a holder does, the gap between
/// them was seen, and only what reaches below it is beside it.
fn beside(patient: &Patient, p: Vec3, n: Vec3) -> Option<f64> {
    let (cells, labels) = (&patient.survey.cells, &patient.labels);
    let at = cells.at(p)?;
    if !patient.near_foreign[cells.offset(at)] {
        return None;
    }
    let from_here = |cell| {
        let d = sub(cells.centre(cell), p);
        (norm(d), dot(d, n))
    };
    let foreign: Vec<(f64, f64)> = cells
        .block(at, BESIDE_CELLS)
        .filter(|&cell| matches!(labels[cells.offset(cell)], Label::Attached | Label::Other))
        .map(from_here)
        .collect();
    let covers = |&(distance, height): &(f64, f64)| {
        height > COVER_MM.0 && distance * distance - height * height < COVER_MM.1 * COVER_MM.1
    };
    let (reach, level) = if foreign.iter().any(covers) { COVERED_MM } else { BESIDE_MM };
    let beside = foreign.into_iter().filter(|f| f.0 <= reach && f.1 < level);
    beside.map(|f| f.0).min_by(f64::total_cmp)
}
