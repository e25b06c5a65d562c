//! The air outside: what a ball can reach from the sides of the scan, and a little further.

use std::collections::HashMap;

use rayon::prelude::*;

use super::distance::squared_distance;
use super::enclosure::enclosure;
use super::patient::{Cell, Patient, each_cell};
use super::pieces::Pieces;
use super::survey::Cells;
use crate::geometry::{Vec3, add, scale};

/// The ball that air outside lets pass, mm.
const BALL_MM: f64 = 4.0;
/// Air behind what hangs on the patient is outside if less of the view from it is the patient.
const ENCLOSURE: f64 = 0.8;
/// How far beyond the ball's reach a fold is still skin, mm (nostrils and ear canals deeper than
/// that are inside).
const FOLD_MM: f64 = 4.0;
/// Narrow air deeper than this is no fold: a nostril, an ear canal, a mouth. It is closed at its
/// rim, mm.
const CANAL_MM: f64 = 12.0;
/// How much longer than the shortest one a way into a canal may be, mm.
const WAY_MM: f64 = 3.0;
/// How far the closing of a canal reaches into the open air before it, mm.
const RIM_MM: f64 = 2.5;
/// How far before a border the survey is asked, in cells.
const STEPS_OUT: [f64; 4] = [2.1, 1.6, 1.1, 0.6];
/// So near to a side of the survey air counts as coming from outside, in cells.
const SIDE_CELLS: usize = 6;
/// Chamfer steps of the walk into narrow air, in thirds of a cell.
const STEPS: [u32; 4] = [0, 3, 4, 5];

/// What lies on the far side of a border, as seen from the patient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Beyond {
    /// Open air, or a shallow fold.
    Outside,
    /// A nostril, an ear canal, the slit of a mouth; so many mm before the border.
    Canal(f64),
    /// A cavity, or another body.
    Inside,
}

/// For every survey cell: is it outside?
#[derive(Debug)]
pub(super) struct Outside {
    cells: Cells,
    open: Vec<u8>,
}

const SOLID: u8 = 0;
const OPEN: u8 = 1;
const CANAL: u8 = 2;
const ENCLOSED: u8 = 3;

/// The air that a ball reaches from the sides of the scan.
#[derive(Debug)]
pub(super) struct Open {
    cells: Cells,
    open: Vec<u8>,
}

impl Open {
    /// Walks in from the sides of the scan, not from below its lower end: what the scan cuts open
    /// there (a mouth, a windpipe) is no outside. Another body lets pass, and so does what hangs on the
    /// patient, for the skin behind it is skin where a gap shows it; but not into the body.
    pub(super) fn find(patient: &Patient) -> Self {
        let (cells, kinds) = (patient.survey.cells, &patient.kinds);
        let below = |i: usize| patient.survey.below[i];
        let mut open = flood(&cells, |i| matches!(kinds[i], Cell::Patient | Cell::Attached) || below(i));
        if kinds.contains(&Cell::Attached) {
            let through = flood(&cells, |i| kinds[i] == Cell::Patient || below(i));
            open.par_iter_mut().zip(through).enumerate().for_each(|(i, (open, through))| {
                let solid = kinds[i] == Cell::Patient || below(i);
                if solid != (*open == SOLID) {
                    *open = ENCLOSED;
                }
                let opened = *open == ENCLOSED && through == OPEN;
                if opened && enclosure(&cells, i, |j| kinds[j] == Cell::Patient) < ENCLOSURE {
                    *open = OPEN;
                }
            });
        }
        Self { cells, open }
    }

    /// Whether a survey cell is air outside.
    pub(super) fn is_open(&self, cell: usize) -> bool {
        self.open[cell] == OPEN
    }
}

/// What a ball reaches from the sides of the scan past what is solid.
fn flood(cells: &Cells, solid: impl Fn(usize) -> bool + Sync) -> Vec<u8> {
    let distance = squared_distance(cells.shape, cells.squared(BALL_MM), &solid);
    let free = Pieces::of(cells.shape, |i| distance[i] == u16::MAX);
    drop(distance);
    let reached = reached_from_the_sides(cells, &free);
    let mut ball = vec![false; cells.len()];
    for z in 0..cells.shape[2] {
        for y in 0..cells.shape[1] {
            for run in free.row(z, y).iter().filter(|r| reached[r.piece as usize]) {
                let base = cells.offset([0, y, z]);
                ball[base + run.start as usize..base + run.end as usize].fill(true);
            }
        }
    }
    let swept = squared_distance(cells.shape, cells.squared(BALL_MM + 0.5 * cells.edge), |i| ball[i]);
    let state = |i: usize| {
        if solid(i) {
            SOLID
        } else if swept[i] == u16::MAX {
            ENCLOSED
        } else {
            OPEN
        }
    };
    (0..cells.len()).into_par_iter().map(state).collect()
}

impl Outside {
    /// The open air, and of the narrow air beside it what is a fold of the skin and what a canal.
    pub(super) fn find(patient: &Patient) -> Self {
        let Open { cells, mut open } = Open::find(patient);
        close_canals(&cells, &mut open);
        Self { cells, open }
    }

    /// How far before a border [`Self::beyond`] looks, mm.
    pub(super) fn reach_mm(&self) -> f64 {
        STEPS_OUT[0] * self.cells.edge
    }

    /// What lies beyond a border at `p` whose outward normal is `n`.
    pub(super) fn beyond(&self, p: Vec3, n: Vec3) -> Beyond {
        let mut side = Beyond::Inside;
        for step in STEPS_OUT {
            if let Some(cell) = self.cells.at(add(p, scale(n, step * self.cells.edge))) {
                match self.open[self.cells.offset(cell)] {
                    OPEN => side = Beyond::Outside,
                    // Next to the rim of a canal the canal decides.
                    CANAL if step < 2.0 => return Beyond::Canal(step * self.cells.edge),
                    CANAL => side = Beyond::Canal(step * self.cells.edge),
                    ENCLOSED => side = Beyond::Inside,
                    _ => {}
                }
            }
        }
        side
    }
}

/// Marks the narrow air that is fold (open) and the one that is canal: what lies deeper than a
/// fold, and the whole way from the open air to what is deeper than any fold.
fn close_canals(cells: &Cells, open: &mut [u8]) {
    let thirds = |mm: f64| (mm / cells.edge * 3.0).round() as u32;
    let (fold, canal) = (thirds(FOLD_MM), thirds(CANAL_MM));
    let from = next_to_narrow(cells, open);
    let narrow = walk(cells, &from, canal + 5, |i| open[i] == ENCLOSED);
    let deep: Vec<usize> = narrow.iter().filter(|&&(_, d)| d > canal).map(|&(i, _)| i).collect();
    let depth: HashMap<usize, u32> = narrow.into_iter().collect();
    let (slack, rim) = (thirds(WAY_MM), thirds(RIM_MM));
    let back = walk(cells, &deep, canal + slack + rim, |i| open[i] == OPEN || depth.contains_key(&i));
    for (&i, &d) in &depth {
        open[i] = if d > fold { CANAL } else { OPEN };
    }
    for (i, d) in back {
        let on_the_way = match depth.get(&i) {
            Some(depth) => depth + d <= canal + slack,
            None => d <= canal + slack.max(rim),
        };
        if on_the_way {
            open[i] = CANAL;
        }
    }
}

/// The open cells that share a face, an edge or a corner with narrow ones.
fn next_to_narrow(cells: &Cells, open: &[u8]) -> Vec<usize> {
    let [nx, ny, nz] = cells.shape;
    let mut next = Vec::new();
    each_cell(cells, |i, [x, y, z]| {
        if open[i] != ENCLOSED {
            return;
        }
        for (dz, dy, dx) in neighbours() {
            let (Some(x), Some(y), Some(z)) =
                (x.checked_add_signed(dx), y.checked_add_signed(dy), z.checked_add_signed(dz))
            else {
                continue;
            };
            if x < nx && y < ny && z < nz && open[(z * ny + y) * nx + x] == OPEN {
                next.push((z * ny + y) * nx + x);
            }
        }
    });
    next.sort_unstable();
    next.dedup();
    next
}

/// Cells for which `pass` holds, reached from `from` within `most` chamfer thirds, with their
/// distance; in the order in which they were reached.
fn walk(cells: &Cells, from: &[usize], most: u32, pass: impl Fn(usize) -> bool) -> Vec<(usize, u32)> {
    let [nx, ny, nz] = cells.shape;
    let mut best: HashMap<usize, u32> = HashMap::new();
    let mut buckets: Vec<Vec<usize>> = vec![Vec::new(); most as usize + 6];
    buckets[0] = from.to_vec();
    let mut reached = Vec::new();
    for d in 0..=most {
        let mut i = 0;
        while i < buckets[d as usize].len() {
            let offset = buckets[d as usize][i];
            i += 1;
            if d > 0 {
                if best.get(&offset) != Some(&d) {
                    continue;
                }
                reached.push((offset, d));
                best.insert(offset, 0);
            }
            let (x, y, z) = (offset % nx, offset / nx % ny, offset / (nx * ny));
            for (dz, dy, dx) in neighbours() {
                let (Some(x), Some(y), Some(z)) =
                    (x.checked_add_signed(dx), y.checked_add_signed(dy), z.checked_add_signed(dz))
                else {
                    continue;
                };
                if x >= nx || y >= ny || z >= nz {
                    continue;
                }
                let next = (z * ny + y) * nx + x;
                if !pass(next) {
                    continue;
                }
                let total = d + STEPS[dx.unsigned_abs() + dy.unsigned_abs() + dz.unsigned_abs()];
                if total <= most && best.get(&next).is_none_or(|&b| b > total) {
                    best.insert(next, total);
                    buckets[total as usize].push(next);
                }
            }
        }
    }
    reached
}

fn neighbours() -> impl Iterator<Item = (isize, isize, isize)> {
    (-1..=1)
        .flat_map(|z| (-1..=1).flat_map(move |y| (-1..=1).map(move |x| (z, y, x))))
        .filter(|&n| n != (0, 0, 0))
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
