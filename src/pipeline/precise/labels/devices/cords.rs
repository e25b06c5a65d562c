//! Cords, leads, tubes and cannulas on the skin: what is slender and long, or slender and larger than anything
//! slender on a head.
//!
//! They are labelled before sheets and hung pieces are judged: a cord costs the skin under and beside it and no
//! more.

use rayon::prelude::*;

use crate::geometry::{Vec3, add, eigenvalues, scale, sub};
use crate::observer::stop::Asked;
use crate::pipeline::precise::grid::cells::Cells;
use crate::pipeline::precise::grid::index::Cell;
use crate::pipeline::precise::grid::pieces::Pieces;
use crate::pipeline::precise::grid::reach::within;
use crate::pipeline::precise::labels::label::Label;
use crate::pipeline::precise::labels::slender::Slender;

/// A cord stands higher over what the ball leaves, mm.
/// Measured by `tools/skin_model/slender.py` (FINDINGS.md): of the points on the cords of a real head 0.96 lie
/// within 3.5 mm of what does, of its skin 0.014.
pub(crate) const OUT_MM: f64 = 0.6;
/// A cord is longer than this, mm,
const CORD_MM: f64 = 30.0;
/// and its standard deviation along its second axis no more than this share of that along its first.
/// Measured by `tools/skin_model/slender.py` (FINDINGS.md): cords 0.05 to 0.17, rims of ears 0.24 to 0.7.
const CORD_WIDTH: f64 = 0.2;
/// Nothing slender of a head is larger, mm: of ears with lobes the largest is 80 (the same).
const LARGEST_OWN_MM: f64 = 110.0;
/// A cord's foot reaches so far beside what of it stands out, mm.
const FOOT_MM: f64 = 2.5;
/// Of a cord no more than so much lies, mm³,
const CORD_MM3: f64 = 400.0;
/// within so many mm. Measured by the same: 110 of a cord of 3 mm, 60 to 350 of those on two real heads; half of
/// what is slender of ears and noses has more than 500 around it.
const AROUND_MM: f64 = 10.0;

/// Marks as [`Label::Attached`] the patient's cells that are a cord's, with its foot; `opened` are the cells of
/// the body that a ball enters.
pub(crate) fn mark(asked: Asked<'_>, slender: &Slender, opened: &[bool], labels: &mut [Label]) {
    let cells = slender.cells();
    let is_patient = |i: usize| labels[i] == Label::Patient;
    let is_cord = |piece: &Vec<usize>| {
        asked.ask();
        let long = extent(cells, piece);
        slender.are_high(piece) && (long > LARGEST_OWN_MM || long > CORD_MM && is_rod(cells, piece))
    };
    let threads = threads(asked, cells, |i| slender.is_out(i) && is_patient(i));
    let cords = pieces(asked, cells, |i| threads[i]).into_iter().filter(is_cord).flatten();
    let mut cord = vec![false; cells.len()];
    let mut found = false;
    for i in cords {
        (cord[i], found) = (true, true);
    }
    if !found {
        return;
    }
    let foot = within(asked, cells.shape, cells.squared(FOOT_MM), |i| cord[i]);
    for (i, label) in labels.iter_mut().enumerate() {
        asked.ask_at(i);
        if foot[i] && !opened[i] && *label == Label::Patient {
            *label = Label::Attached;
        }
    }
}

/// Which cells of long pieces of what stands out have no more of it around them than a cord.
fn threads(asked: Asked<'_>, cells: &Cells, is_out: impl Fn(usize) -> bool + Sync) -> Vec<bool> {
    let mut threads = vec![false; cells.len()];
    for piece in pieces(asked, cells, &is_out) {
        if extent(cells, &piece) > CORD_MM {
            let is_thread = |&i: &usize| {
                asked.ask();
                let around = around(cells, i).filter(|&j| is_out(j)).count();
                around as f64 * cells.edge.powi(3) < CORD_MM3
            };
            let of_piece: Vec<bool> = piece.par_iter().panic_fuse().map(is_thread).collect();
            piece.into_iter().zip(of_piece).for_each(|(i, is)| threads[i] = is);
        }
    }
    threads
}

/// Whether cells spread along one axis far more than along any other.
fn is_rod(cells: &Cells, piece: &[usize]) -> bool {
    let places = || piece.iter().map(|&i| cells.centre(cells.cell(i)));
    let count = piece.len() as f64;
    let middle = scale(places().fold([0.0; 3], add), 1.0 / count);
    let mut spread = [[0.0; 3]; 3];
    for d in places().map(|place| sub(place, middle)) {
        for (a, row) in spread.iter_mut().enumerate() {
            row.iter_mut().zip(d).for_each(|(v, b)| *v += d[a] * b / count);
        }
    }
    let [_, width, length]: Vec3 = eigenvalues(spread).map(|v| v.max(0.0).sqrt());
    width < CORD_WIDTH * length
}

/// The cells of each connected piece.
fn pieces(asked: Asked<'_>, cells: &Cells, marked: impl Fn(usize) -> bool + Sync) -> Vec<Vec<usize>> {
    let pieces = Pieces::of(asked, cells.shape, marked);
    let mut found = vec![Vec::new(); pieces.sizes().len()];
    pieces.each_row(|[y, z], run| {
        asked.ask_at(y);
        let row = cells.offset(Cell([0, y, z]));
        found[run.piece as usize].extend(row + run.start as usize..row + run.end as usize);
    });
    found
}

/// Diagonal of the box around the centres of some cells, mm.
fn extent(cells: &Cells, of: &[usize]) -> f64 {
    let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
    for at in of.iter().map(|&i| cells.cell(i)) {
        for a in 0..3 {
            low[a] = low[a].min(at[a]);
            high[a] = high[a].max(at[a]);
        }
    }
    let squares = (0..3).map(|a| ((high[a].saturating_sub(low[a])) as f64).powi(2));
    squares.sum::<f64>().sqrt() * cells.edge
}

/// The cells in a ball around one.
fn around(cells: &Cells, cell: usize) -> impl Iterator<Item = usize> {
    let reach = (AROUND_MM / cells.edge) as usize;
    let at = cells.cell(cell);
    let is_in_ball =
        move |to: &Cell| (0..3).map(|a| to[a].abs_diff(at[a]).pow(2)).sum::<usize>() <= reach * reach;
    cells.block(at, reach).filter(is_in_ball).map(|to| cells.offset(to))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::precise::grid::cells::each_cell;

    /// A block whose face is at z = 40, with a cord, an ear and a thick pad on it.
    #[test]
    fn cords_are_found_and_ears_and_the_edges_of_pads_are_not() {
        let cells = Cells { origin: [0.0; 3], edge: 1.0, shape: [140, 140, 75] };
        let is_in = |v: usize, from: usize, size: usize| (from..from + size).contains(&v);
        let cord = |[x, y, z]: [usize; 3]| is_in(z, 40, 4) && is_in(x, 20, 4) && is_in(y, 10, 90);
        let ear = |[x, y, z]: [usize; 3]| is_in(x, 100, 4) && is_in(y, 20, 60) && is_in(z, 40, 28);
        let pad = |[x, y, z]: [usize; 3]| is_in(x, 70, 50) && is_in(y, 95, 35) && is_in(z, 40, 12);
        let is_solid = |i: usize| {
            let at = cells.cell(i).0;
            is_in(at[2], 8, 32) || cord(at) || ear(at) || pad(at)
        };
        let label = |i: usize| if is_solid(i) { Label::Patient } else { Label::Air };
        let mut labels: Vec<Label> = (0..cells.len()).map(label).collect();
        let (slender, opened) = Slender::in_cells(Asked::default(), cells, OUT_MM, is_solid);
        mark(Asked::default(), &slender, &opened, &mut labels);
        let (mut marked, mut all, mut wrong) = (0, 0, 0);
        each_cell(&cells, |i, at| {
            all += usize::from(cord(at.0));
            let is_marked = labels[i] == Label::Attached;
            marked += usize::from(cord(at.0) && is_marked);
            wrong += usize::from(!cord(at.0) && is_marked);
        });
        // Its lowest layer is so flat that the ball reaches it.
        assert_eq!((marked, all), (3 * 4 * 90, 4 * 4 * 90));
        assert_eq!(wrong, 0);
    }
}
