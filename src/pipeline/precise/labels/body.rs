//! Which tissue is the body, told in 3D, by what hangs together and how thick it is.
//!
//! Opening with a ball leaves what is thick: the body. Where a gap is seen between two bodies, however
//! narrow, they are parted at the scan's full resolution.

use rayon::prelude::*;

use super::devices::couch::{self, Outline};
use super::label::{BALL_MM, Label, tissue};
use crate::geometry::{Vec3, add};
use crate::pipeline::precise::grid::bit_rows::BitRows;
use crate::pipeline::precise::grid::cells::Cells;
use crate::pipeline::precise::grid::index::{Cell, Voxel};
use crate::pipeline::precise::grid::pieces::Pieces;
use crate::pipeline::precise::grid::reach::within;
use crate::pipeline::precise::scan::Scan;
use crate::pipeline::precise::scan::levels::Levels;
use crate::pipeline::precise::scan::sampler::Sampler;
use crate::pipeline::precise::scan::survey::Survey;

/// What lies so close to the opened body belongs to it without further question, mm.
const SKIN_MM: f64 = 1.5;
/// A couch is seen apart from the patient if no more than this share of its cells is the patient's.
const LENT: f64 = 0.3;

/// The body, and what is not yet told apart from it.
#[derive(Debug)]
pub(super) struct Body {
    /// What each cell of the survey holds: the patient wherever tissue hangs together with the body.
    pub(super) labels: Vec<Label>,
    /// The cells so close to the opened body that they belong to it.
    pub(super) near: Vec<bool>,
    /// The scan's clear tissue in the scan's voxels.
    pub(super) tissue: OwnTissue,
}

/// The pieces of clear tissue in the scan's voxels, and which of them have a part in the body.
#[derive(Debug)]
pub(super) struct OwnTissue {
    pieces: Pieces,
    own: Vec<bool>,
}

impl OwnTissue {
    /// Whether the clear tissue in a voxel is the body's; `None` where there is none.
    pub(super) fn at(&self, Voxel([z, y, x]): Voxel) -> Option<bool> {
        self.pieces.at(z, y, x).map(|piece| self.own[piece as usize])
    }

    /// What a cell with some tissue in it is: the body's if any clear tissue in it is.
    fn owner(&self, sampler: &Sampler, centre: Vec3, edge: f64) -> Label {
        let mut found = Label::Air;
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
            match self.at(sampler.clamped(add(centre, d)).nearest()) {
                Some(true) => return Label::Patient,
                Some(false) => found = Label::Other,
                None => {}
            }
        }
        found
    }
}

impl Body {
    /// Finds the body; `None` if nothing in the scan is thick enough to be one.
    pub(super) fn find(scan: &Scan<'_>, survey: &Survey, pieces: Pieces) -> Option<Self> {
        let Scan { sampler, levels, .. } = scan;
        let cells = survey.cells;
        let mut labels = tissue(survey, levels);
        sampler.ask();
        let couch = couch::mark(sampler.asked(), survey, &mut labels);
        sampler.ask();
        let mut core = core(sampler, &cells, &labels)?;
        sampler.ask();
        let own = own_pieces(sampler, &pieces, &cells, &core);
        let tissue = OwnTissue { pieces, own };
        let owner = |i: usize| {
            sampler.ask_at(i);
            tissue.owner(sampler, cells.centre(cells.cell(i)), cells.edge)
        };
        let thick = || opened(sampler, &cells, |i| labels[i] != Label::Air);
        sampler.ask();
        let lent = lent(&couch, owner, thick);
        if !lent.is_empty() {
            for &i in &lent {
                labels[i] = Label::Patient;
            }
            core = self::core(sampler, &cells, &labels)?;
        }
        sampler.ask();
        labels.par_iter_mut().enumerate().panic_fuse().for_each(|(i, label)| {
            if *label == Label::Patient && !core[i] {
                *label = owner(i);
            }
        });
        sampler.ask();
        let reach = cells.squared(BALL_MM + SKIN_MM);
        let near = within(sampler.asked(), cells.shape, reach, |i| core[i]);
        drop(core);
        // What is thin there is the holder where it is not seen apart.
        for i in lent.into_iter().filter(|&i| !near[i]) {
            labels[i] = Label::Other;
        }
        Some(Self { labels, near, tissue })
    }
}

/// The pieces of the scan's clear tissue, in its voxels.
pub(super) fn clear_pieces(sampler: &Sampler, levels: &Levels) -> Pieces {
    let [nz, ny, nx] = sampler.shape;
    let upper = levels.upper().ceil() as i16;
    let clear = BitRows::of(sampler.asked(), nx, sampler.hu, |&v| v >= upper);
    sampler.ask();
    Pieces::of_rows(sampler.asked(), [nx, ny, nz], &clear)
}

/// The cells of the body: the largest piece that the ball leaves; `None` if it leaves nothing.
fn core(sampler: &Sampler, cells: &Cells, labels: &[Label]) -> Option<Vec<bool>> {
    let asked = sampler.asked();
    let at_border = within(asked, cells.shape, cells.squared(BALL_MM), |i| labels[i] != Label::Patient);
    let inner = Pieces::of(asked, cells.shape, |i| !at_border[i]);
    let main = inner.largest()?;
    let mut core = vec![false; cells.len()];
    inner.each_row(|[y, z], run| {
        if run.piece == main {
            let row = cells.offset(Cell([0, y, z]));
            core[row + run.start as usize..row + run.end as usize].fill(true);
        }
    });
    Some(core)
}

/// Which of the scan's pieces of clear tissue have a part in the body.
fn own_pieces(sampler: &Sampler, pieces: &Pieces, cells: &Cells, core: &[bool]) -> Vec<bool> {
    let row = cells.shape[0];
    let in_row = |r: usize| {
        sampler.ask();
        let cells_in = (r * row..(r + 1) * row).filter(|&i| core[i]);
        let mut found: Vec<u32> =
            cells_in.filter_map(|i| piece_at(sampler, pieces, cells.centre(cells.cell(i)))).collect();
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
    owner: impl Fn(usize) -> Label + Sync,
    thick: impl FnOnce() -> Vec<bool>,
) -> Vec<usize> {
    let (mut lent, mut in_one) = (Vec::new(), Vec::new());
    for outline in couch {
        let cells = outline.cells.par_iter().copied().panic_fuse();
        let own: Vec<usize> = cells.filter(|&i| owner(i) == Label::Patient).collect();
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
fn opened(sampler: &Sampler, cells: &Cells, solid: impl Fn(usize) -> bool + Sync) -> Vec<bool> {
    let reach = cells.squared(BALL_MM);
    let at_border = within(sampler.asked(), cells.shape, reach, |i| !solid(i));
    within(sampler.asked(), cells.shape, reach, |i| !at_border[i])
}

fn piece_at(sampler: &Sampler, pieces: &Pieces, p: Vec3) -> Option<u32> {
    let Voxel([z, y, x]) = sampler.clamped(p).nearest();
    pieces.at(z, y, x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_couch_only_what_is_seen_apart_or_thick_in_a_thin_outline_is_given_back() {
        let outline = |thin| [Outline { cells: (0..100).collect(), thin }];
        let thick = || (0..100).map(|i| (10..30).contains(&i)).collect();
        let some = lent(&outline(false), |i| if i < 20 { Label::Patient } else { Label::Other }, thick);
        assert_eq!(some, (0..20).collect::<Vec<_>>());
        let in_one = |i| if i < 90 { Label::Patient } else { Label::Other };
        let couch = lent(&outline(false), in_one, thick);
        assert!(couch.is_empty(), "the couch itself: {couch:?}");
        assert_eq!(lent(&outline(true), in_one, thick), (10..30).collect::<Vec<_>>());
    }
}
