//! The air outside: what a ball can reach from the sides of the scan, and a little further.

use rayon::prelude::*;

use super::air::Air;
use super::canals::close_canals;
use super::field_border::FieldBorder;
use super::label::Label;
use crate::geometry::{Vec3, add, scale};
use crate::observer::stop::Asked;
use crate::pipeline::precise::grid::cells::Cells;
use crate::pipeline::precise::grid::index::Cell;
use crate::pipeline::precise::grid::pieces::Pieces;
use crate::pipeline::precise::grid::rays::enclosure;
use crate::pipeline::precise::grid::reach::within;
use crate::pipeline::precise::scan::survey::Survey;

/// The ball that air outside lets pass, mm.
const BALL_MM: f64 = 4.0;
/// Air behind what hangs on the patient is outside if less of the view from it is the patient.
const ENCLOSURE: f64 = 0.8;
/// How far before a border the survey is asked, in cells.
const STEPS_OUT: [f64; 4] = [2.1, 1.6, 1.1, 0.6];
/// So near to a side of the survey air counts as coming from outside, in cells.
const SIDE_CELLS: usize = 6;

/// What lies on the far side of a border, as seen from the patient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Beyond {
    /// Open air, or a shallow fold.
    Outside,
    /// A nostril, an ear canal, the slit of a mouth; so many mm before the border.
    Canal(f64),
    /// The border of the field of view, where it cuts the patient.
    Cut,
    /// A cavity, or another body.
    Inside,
}

/// For every survey cell: is it outside?
#[derive(Debug)]
pub(crate) struct Outside {
    cells: Cells,
    open: Vec<Air>,
    near: Vec<bool>,
}

/// The air that a ball reaches from the sides of the scan.
#[derive(Debug)]
pub(crate) struct Open {
    cells: Cells,
    open: Vec<Air>,
}

impl Open {
    /// Walks in from the sides of the scan, not from below its lower end nor where the field of view
    /// cuts the patient: what is cut open there (a mouth, a windpipe, a sinus) is no outside. Another
    /// body lets pass, and so does what hangs on the patient, for the skin behind it is skin where a gap
    /// shows it; but not into the body.
    pub(crate) fn find(
        asked: Asked<'_>,
        survey: &Survey,
        labels: &[Label],
        field_border: &FieldBorder,
    ) -> Self {
        let cells = survey.cells;
        let laid_open = field_border.laid_open(asked, survey, labels);
        let shut = |i: usize| survey.below[i] || laid_open.get(i).is_some_and(|l| *l);
        let mut open =
            flood(asked, &cells, |i| matches!(labels[i], Label::Patient | Label::Attached) || shut(i));
        if labels.contains(&Label::Attached) {
            let through = flood(asked, &cells, |i| labels[i] == Label::Patient || shut(i));
            open.par_iter_mut().zip(through).enumerate().panic_fuse().for_each(|(i, (open, through))| {
                asked.ask_at(i);
                let solid = labels[i] == Label::Patient || shut(i);
                if solid != (*open == Air::Solid) {
                    *open = Air::Enclosed;
                }
                let opened = *open == Air::Enclosed && through == Air::Open;
                if opened && enclosure(&cells, i, |j| labels[j] == Label::Patient) < ENCLOSURE {
                    *open = Air::Open;
                }
            });
        }
        for i in 0..laid_open.len() {
            asked.ask_at(i);
            if laid_open[i] && labels[i] != Label::Patient {
                open[i] = Air::Shut;
            }
        }
        Self { cells, open }
    }

    /// Whether a survey cell is air outside.
    pub(crate) fn is_open(&self, cell: usize) -> bool {
        self.open[cell] == Air::Open
    }

    /// Whether a survey cell is air that the patient encloses.
    pub(crate) fn is_enclosed(&self, cell: usize) -> bool {
        self.open[cell] == Air::Enclosed
    }
}

/// What a ball reaches from the sides of the scan past what is solid.
fn flood(asked: Asked<'_>, cells: &Cells, solid: impl Fn(usize) -> bool + Sync) -> Vec<Air> {
    let tight = within(asked, cells.shape, cells.squared(BALL_MM), &solid);
    let free = Pieces::of(asked, cells.shape, |i| !tight[i]);
    drop(tight);
    let reached = reached_from_the_sides(cells, &free);
    let mut ball = vec![false; cells.len()];
    for z in 0..cells.shape[2] {
        asked.ask();
        for y in 0..cells.shape[1] {
            for run in free.row(z, y).iter().filter(|r| reached[r.piece as usize]) {
                let base = cells.offset(Cell([0, y, z]));
                ball[base + run.start as usize..base + run.end as usize].fill(true);
            }
        }
    }
    let swept = within(asked, cells.shape, cells.squared(BALL_MM + 0.5 * cells.edge), |i| ball[i]);
    let state = |i: usize| {
        asked.ask_at(i);
        if solid(i) {
            Air::Solid
        } else if !swept[i] {
            Air::Enclosed
        } else {
            Air::Open
        }
    };
    (0..cells.len()).into_par_iter().panic_fuse().map(state).collect()
}

impl Outside {
    /// The open air, and of the narrow air beside it what is a fold of the skin and what a canal.
    pub(crate) fn find(
        asked: Asked<'_>,
        survey: &Survey,
        labels: &[Label],
        field_border: &FieldBorder,
    ) -> Self {
        let Open { cells, mut open } = Open::find(asked, survey, labels, field_border);
        close_canals(asked, &cells, &mut open);
        // Both cells' corners on the way to the furthest place that is asked.
        let reach = ((STEPS_OUT[0] + 3f64.sqrt()).powi(2)).floor() as u16;
        let near =
            within(asked, cells.shape, reach, |i| matches!(open[i], Air::Open | Air::Canal | Air::Shut));
        Self { cells, open, near }
    }

    /// The air of each survey cell.
    pub(crate) fn air(&self) -> &[Air] {
        &self.open
    }

    /// Whether what lies beyond a border at `p` can be anything but inside.
    pub(crate) fn is_near(&self, p: Vec3) -> bool {
        self.cells.at(p).is_none_or(|cell| self.near[self.cells.offset(cell)])
    }

    /// How far before a border [`Self::beyond`] looks, mm.
    pub(crate) fn reach_mm(&self) -> f64 {
        STEPS_OUT[0] * self.cells.edge
    }

    /// What lies beyond a border at `p` whose outward normal is `n`.
    pub(crate) fn beyond(&self, p: Vec3, n: Vec3) -> Beyond {
        let mut side = Beyond::Inside;
        for step in STEPS_OUT {
            if let Some(cell) = self.cells.at(add(p, scale(n, step * self.cells.edge))) {
                match self.open[self.cells.offset(cell)] {
                    Air::Open => side = Beyond::Outside,
                    // Next to the rim of a canal the canal decides.
                    Air::Canal if step < 2.0 => return Beyond::Canal(step * self.cells.edge),
                    Air::Canal => side = Beyond::Canal(step * self.cells.edge),
                    Air::Enclosed => side = Beyond::Inside,
                    Air::Shut => side = Beyond::Cut,
                    Air::Solid => {}
                }
            }
        }
        side
    }
}

/// Which pieces of free air come to a side, the front or the back of the survey: the air of the
/// windpipe, that reaches its lower end alone, does not.
fn reached_from_the_sides(cells: &Cells, free: &Pieces) -> Vec<bool> {
    let mut reached = vec![false; free.sizes().len()];
    let at_side = |v: usize, axis: usize| v < SIDE_CELLS || v + SIDE_CELLS >= cells.shape[axis];
    free.each_row(|[y, _], run| {
        let (first, last) = (run.start as usize, run.end as usize - 1);
        reached[run.piece as usize] |= at_side(first, 0) || at_side(last, 0) || at_side(y, 1);
    });
    reached
}
