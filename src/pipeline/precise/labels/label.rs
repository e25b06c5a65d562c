//! What a cell of the survey holds.

use rayon::prelude::*;

use crate::pipeline::precise::scan::levels::Levels;
use crate::pipeline::precise::scan::survey::Survey;

/// A body must be thicker than twice this to count as the patient's own, mm.
pub(crate) const BALL_MM: f64 = 5.0;

/// What a survey cell holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub(crate) enum Label {
    #[default]
    /// Air, padding, or something too thin to be seen as tissue.
    Air,
    /// The patient.
    Patient,
    /// Tissue or plastic that is not the patient.
    Other,
    /// A thin long piece that hangs on the patient: holder, couch, strap, tube.
    Attached,
}

/// The cells with tissue in their middle, as if all of it were the patient's.
pub(crate) fn tissue(survey: &Survey, levels: &Levels) -> Vec<Label> {
    let middle = levels.middle();
    let kind = |&hu: &i16| if f32::from(hu) >= middle { Label::Patient } else { Label::Air };
    survey.hu.par_iter().map(kind).collect()
}
