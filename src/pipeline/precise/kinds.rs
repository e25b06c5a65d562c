//! What the survey's cells hold.

use rayon::prelude::*;

use super::levels::Levels;
use super::survey::{Cells, Survey};

/// A body must be thicker than twice this to count as the patient's own, mm.
pub(super) const BALL_MM: f64 = 5.0;

/// What a survey cell holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub(super) enum Cell {
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
pub(super) fn tissue(survey: &Survey, levels: &Levels) -> Vec<Cell> {
    let middle = levels.middle();
    let kind = |&hu: &i16| if f32::from(hu) >= middle { Cell::Patient } else { Cell::Air };
    survey.hu.par_iter().map(kind).collect()
}

/// Calls `f` with the offset and the index of every cell, in order.
pub(super) fn each_cell(cells: &Cells, mut f: impl FnMut(usize, [usize; 3])) {
    let [nx, ny, nz] = cells.shape;
    let mut offset = 0;
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                f(offset, [x, y, z]);
                offset += 1;
            }
        }
    }
}
