//! Which tissue is the patient: told in 3D, by what hangs together and how thick it is.
//!
//! Opening with a ball leaves what is thick: the body. What the ball could not enter hangs on it
//! in pieces: ears, nose and jaw are small; a holder, a couch, straps and tubes are long. Where a
//! gap is seen between two bodies, however narrow, they are parted at the scan's full resolution.

use rayon::prelude::*;

use super::couch::{self, Outline};
use super::crop;
use super::field::Field;
use super::kinds::{BALL_MM, Cell, tissue};
use super::levels::Levels;
use super::openings::FieldBorder;
use super::outside::Open;
use super::pieces::Pieces;
use super::reach::within;
use super::rows::Rows;
use super::space::{Space, nearest};
use super::survey::{Cells, Survey};
use super::{parts, sheets};
use crate::geometry::{Vec3, add, scale};

/// Edge of the survey's cells, mm; larger where the patient is.
const EDGE_MM: f64 = 1.0;
/// What lies so close to the opened body belongs to it without further question, mm.
const SKIN_MM: f64 = 1.5;
/// A couch is seen apart from the patient if no more than this share of its cells is the patient's.
const LENT: f64 = 0.3;

/// Steps in which clear tissue is looked for behind a border, mm,
const DEPTH_MM: f64 = 0.5;
/// how deep the edge of the skin itself reaches,
pub(super) const CLEAR_MM: f64 = 2.0;
/// and a layer on it that is no clear tissue, such as a bandage, a gel or hair.
const DEEPEST_MM: f64 = 20.0;

/// What is so near something foreign may touch it, mm.
const FOREIGN_MM: f64 = 3.5;
/// The patient in the survey's cells and in the scan's voxels.
#[derive(Debug)]
pub(super) struct Patient {
    /// The survey.
    pub(super) survey: Survey,
    /// What each of its cells holds.
    pub(super) kinds: Vec<Cell>,
    /// Whether each is near one that holds something other than air and patient.
    pub(super) near_foreign: Vec<bool>,
    /// Where the field of view ends.
    pub(super) field_border: FieldBorder,
    pieces: Pieces,
    own: Vec<bool>,
}

impl Patient {
    /// Finds the patient; `None` if nothing in the scan is thick enough to be one.
    pub(super) fn find(space: &Space, levels: &Levels, field: &Field) -> Option<Self> {
        let [nz, ny, nx] = space.shape;
        let upper = levels.upper().ceil() as i16;
        let clear = Rows::of(space.asked(), nx, space.hu, |&v| v >= upper);
        space.ask();
        let pieces = Pieces::of_rows(space.asked(), [nx, ny, nz], &clear);
        space.ask();
        let survey = Survey::of(space, field, Cells::over(crop::bounds(space, field, levels), EDGE_MM));
        let cells = survey.cells;
        space.ask();
        let mut kinds = tissue(&survey, levels);
        space.ask();
        let couch = couch::mark(space.asked(), &survey, &mut kinds);
        space.ask();
        let mut core = core(space, &cells, &kinds)?;
        space.ask();
        let own = own_pieces(space, &pieces, &cells, &core);
        let owner = |i: usize| {
            space.ask_at(i);
            owner(space, &pieces, &own, cells.centre(cells.cell(i)), cells.edge)
        };
        let thick = || opened(space, &cells, |i| kinds[i] != Cell::Air);
        space.ask();
        let lent = lent(&couch, owner, thick);
        if !lent.is_empty() {
            for &i in &lent {
                kinds[i] = Cell::Patient;
            }
            core = self::core(space, &cells, &kinds)?;
        }
        space.ask();
        kinds.par_iter_mut().enumerate().panic_fuse().for_each(|(i, kind)| {
            if *kind == Cell::Patient && !core[i] {
                *kind = owner(i);
            }
        });
        space.ask();
        let reach = cells.squared(BALL_MM + SKIN_MM);
        let near = within(space.asked(), cells.shape, reach, |i| core[i]);
        drop(core);
        // What is thin there is the holder where it is not seen apart.
        for i in lent.into_iter().filter(|&i| !near[i]) {
            kinds[i] = Cell::Other;
        }
        space.ask();
        let field_border = FieldBorder::of(space, levels, field, &survey);
        let mut patient = Self { survey, kinds, near_foreign: Vec::new(), field_border, pieces, own };
        space.ask();
        let open = Open::find(space.asked(), &patient);
        space.ask();
        sheets::peel(space, levels, &patient.survey.cells, &mut patient.kinds, |i| open.is_open(i));
        space.ask();
        let (asked, cells) = (space.asked(), patient.survey.cells);
        parts::judge(asked, &cells, &mut patient.kinds, &near, |i| open.is_open(i));
        space.ask();
        patient.look_for_foreign(space);
        Some(patient)
    }

    /// Whether something that is not the patient is close to a place.
    pub(super) fn is_near_foreign(&self, place: Vec3) -> bool {
        let cells = &self.survey.cells;
        cells.at(place).is_some_and(|cell| self.near_foreign[cells.offset(cell)])
    }

    fn look_for_foreign(&mut self, space: &Space) {
        let (cells, kinds) = (&self.survey.cells, &self.kinds);
        let foreign = |i: usize| matches!(kinds[i], Cell::Attached | Cell::Other);
        self.near_foreign = within(space.asked(), cells.shape, cells.squared(FOREIGN_MM), foreign);
    }

    /// How far behind a border at `p` with the outward normal `n` the first clear tissue is that no
    /// air parts from it, mm, and whether it is the patient's own; `None` if there is none.
    pub(super) fn clear_tissue(
        &self,
        space: &Space,
        levels: &Levels,
        p: Vec3,
        n: Vec3,
    ) -> Option<(f64, bool)> {
        let steps = (DEEPEST_MM / DEPTH_MM) as usize;
        let inward = space.line(p, scale(n, -1.0));
        for d in (1..=steps).map(|step| step as f64 * DEPTH_MM) {
            let index = nearest(space.within(inward.index(d)));
            let [z, y, x] = index;
            if let Some(piece) = self.pieces.at(z, y, x) {
                return Some((d, self.own[piece as usize]));
            }
            if d > CLEAR_MM && space.voxel(index) < levels.middle() {
                return None;
            }
        }
        None
    }
}

/// The cells of the body: the largest piece that the ball leaves; `None` if it leaves nothing.
fn core(space: &Space, cells: &Cells, kinds: &[Cell]) -> Option<Vec<bool>> {
    let asked = space.asked();
    let at_border = within(asked, cells.shape, cells.squared(BALL_MM), |i| kinds[i] != Cell::Patient);
    let inner = Pieces::of(asked, cells.shape, |i| !at_border[i]);
    let main = inner.largest()?;
    let mut core = vec![false; cells.len()];
    inner.each_row(|[y, z], run| {
        if run.piece == main {
            let row = cells.offset([0, y, z]);
            core[row + run.start as usize..row + run.end as usize].fill(true);
        }
    });
    Some(core)
}

/// Which of the scan's pieces of clear tissue have a part in the body.
fn own_pieces(space: &Space, pieces: &Pieces, cells: &Cells, core: &[bool]) -> Vec<bool> {
    let row = cells.shape[0];
    let in_row = |r: usize| {
        space.ask();
        let cells_in = (r * row..(r + 1) * row).filter(|&i| core[i]);
        let mut found: Vec<u32> =
            cells_in.filter_map(|i| piece_at(space, pieces, cells.centre(cells.cell(i)))).collect();
        found.dedup();
        found
    };
    let found: Vec<Vec<u32>> = (0..core.len() / row).into_par_iter().panic_fuse().map(in_row).collect();
    let mut own = vec![false; pieces.sizes().len()];
    for piece in found.into_iter().flatten() {
        own[piece as usize] = true;
    }
    own
}

/// Of the cells of the couch's outlines those that are the patient's: where the head leans over a
/// holder that is seen apart from it, and where `thick` tissue lies in the outline of one that is thin.
fn lent(
    couch: &[Outline],
    owner: impl Fn(usize) -> Cell + Sync,
    thick: impl FnOnce() -> Vec<bool>,
) -> Vec<usize> {
    let (mut lent, mut in_one) = (Vec::new(), Vec::new());
    for outline in couch {
        let cells = outline.cells.par_iter().copied().panic_fuse();
        let own: Vec<usize> = cells.filter(|&i| owner(i) == Cell::Patient).collect();
        if own.len() as f64 <= LENT * outline.cells.len() as f64 {
            lent.extend(own);
        } else if outline.thin {
            in_one.extend(own);
        }
    }
    if !in_one.is_empty() {
        let thick = thick();
        lent.extend(in_one.into_iter().filter(|&i| thick[i]));
    }
    lent
}

/// The cells of what is thick: solid cells that a ball in solid cells reaches.
fn opened(space: &Space, cells: &Cells, solid: impl Fn(usize) -> bool + Sync) -> Vec<bool> {
    let reach = cells.squared(BALL_MM);
    let at_border = within(space.asked(), cells.shape, reach, |i| !solid(i));
    within(space.asked(), cells.shape, reach, |i| !at_border[i])
}

fn piece_at(space: &Space, pieces: &Pieces, p: Vec3) -> Option<u32> {
    let [z, y, x] = nearest(space.clamped(p));
    pieces.at(z, y, x)
}

/// What a cell with some tissue in it is: the body's if any clear tissue in it is.
fn owner(space: &Space, pieces: &Pieces, own: &[bool], centre: Vec3, edge: f64) -> Cell {
    let mut found = Cell::Air;
    let r = 0.6 * edge;
    for d in [
        [0.0; 3],
        [r, 0.0, 0.0],
        [-r, 0.0, 0.0],
        [0.0, r, 0.0],
        [0.0, -r, 0.0],
        [0.0, 0.0, r],
        [0.0, 0.0, -r],
    ] {
        match piece_at(space, pieces, add(centre, d)) {
            Some(piece) if own[piece as usize] => return Cell::Patient,
            Some(_) => found = Cell::Other,
            None => {}
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_couch_only_what_is_seen_apart_or_thick_in_a_thin_outline_is_given_back() {
        let outline = |thin| [Outline { cells: (0..100).collect(), thin }];
        let thick = || (0..100).map(|i| (10..30).contains(&i)).collect();
        let some = lent(&outline(false), |i| if i < 20 { Cell::Patient } else { Cell::Other }, thick);
        assert_eq!(some, (0..20).collect::<Vec<_>>());
        let in_one = |i| if i < 90 { Cell::Patient } else { Cell::Other };
        let couch = lent(&outline(false), in_one, thick);
        assert!(couch.is_empty(), "the couch itself: {couch:?}");
        assert_eq!(lent(&outline(true), in_one, thick), (10..30).collect::<Vec<_>>());
    }
}
