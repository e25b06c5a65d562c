//! Changes that last: a run of damaged slices of any length, and a patient who moved and stayed.
//!
//! Both show at the boundary of two slices as much more change than is ordinary near it. A run ends with
//! a second such change, the other way in the same places. A movement is one that a shift of the slice
//! explains; anatomy that begins with a slice (shoulders, chin, ears) is explained by none.

use super::place::ordinary;
use super::{BETWEEN, Finding, Kind, Stack, Summary};
use crate::observer::stop::Asked;

/// Distance of the pixels that are looked at, mm.
const CELL_MM: f64 = 2.0;
/// Share of the cells that may change without a word.
const FLOOR: f64 = 0.0005;
/// What comes back, in ordinary changes times the share of the larger change that it is. Heads, skulls
/// and phantoms reach 0.5; a face in blocks of 10 mm 0.9; four slices in 8 mm another place 1.2 to 8.
const MOST_BACK: f64 = 1.0;
/// What comes back of a run that no scan of a patient shows: in ordinary changes, as a share of the
/// larger change, and as a share of the cells.
const SEVERE: (f64, f64, f64) = (4.0, 0.5, 0.02);
/// Slices of a run; fewer are compared with those around them.
const LEAST_RUN: usize = 4;
/// Ordinary changes from which a change may be a movement: one of 6 mm in slices of 4 mm is 1.8 of them.
const LEAST_CHANGE: f64 = 1.6;
/// Share of the change that a shift may leave: of anatomy the best one leaves 0.58 and more, of a head
/// that moved by 6 to 20 mm 0.2 at most.
const MOST_LEFT: f64 = 0.4;
/// Longest shift along rows and columns, cells.
const REACH: usize = 12;

/// Air and tissue in some pixels of a slice.
pub(super) struct Cells {
    /// Cells in a row.
    columns: usize,
    tissue: Vec<bool>,
}

impl Cells {
    pub(super) fn of(slice: &[i16], stack: &Stack<'_>) -> Self {
        let step = |axis: usize| pixels(stack, axis);
        let columns = stack.columns.div_ceil(step(1));
        let rows = slice.chunks_exact(stack.columns).step_by(step(0));
        let tissue = rows.flat_map(|row| row.iter().step_by(step(1)).map(|v| *v > BETWEEN)).collect();
        Self { columns, tissue }
    }
}

/// Pixels from cell to cell along an axis: rows, columns.
fn pixels(stack: &Stack<'_>, axis: usize) -> usize {
    ((CELL_MM * stack.step_px[axis] / stack.step_mm).round() as usize).max(1)
}

/// What changes from a slice to the next: one bit a cell that becomes tissue, and one that becomes air.
struct Change {
    gained: Vec<u64>,
    lost: Vec<u64>,
    /// Cells that change.
    cells: f64,
}

impl Change {
    fn between(before: &Cells, after: &Cells) -> Self {
        let bits = |value: bool| {
            let became = |(before, after): (&bool, &bool)| u64::from(before != after && *after == value);
            let word = |(before, after): (&[bool], &[bool])| {
                before.iter().zip(after).map(became).fold(0_u64, |word, bit| word << 1 | bit)
            };
            before.tissue.chunks(64).zip(after.tissue.chunks(64)).map(word).collect::<Vec<u64>>()
        };
        let (gained, lost) = (bits(true), bits(false));
        let cells = gained.iter().chain(&lost).map(|word| word.count_ones()).sum::<u32>().into();
        Self { gained, lost, cells }
    }

    /// Cells that change here and change back there.
    fn undone_by(&self, other: &Self) -> f64 {
        let both = |a: &[u64], b: &[u64]| a.iter().zip(b).map(|(a, b)| (a & b).count_ones()).sum::<u32>();
        (both(&self.gained, &other.lost) + both(&self.lost, &other.gained)).into()
    }
}

pub(super) fn find(asked: Asked<'_>, stack: &Stack<'_>, summaries: &[Summary]) -> Vec<Finding> {
    let change = |pair: &[Summary]| {
        asked.ask();
        Change::between(&pair[0].cells, &pair[1].cells)
    };
    let changes: Vec<Change> = summaries.windows(2).map(change).collect();
    let cells: Vec<f64> = changes.iter().map(|change| change.cells).collect();
    let mut sorted = cells.clone();
    let rank = sorted.len() / 2;
    let middle = *sorted.select_nth_unstable_by(rank, f64::total_cmp).1;
    let all = summaries[0].cells.tissue.len() as f64;
    let usual: Vec<f64> = (0..cells.len()).map(|z| ordinary(&cells, z).max(middle) + FLOOR * all).collect();
    let finding = |slice, kind, measured, limit, severe| Finding {
        slice,
        kind,
        rows: 0..stack.rows,
        measured,
        limit,
        severe,
    };
    let mut found = Vec::new();
    // Changes that begin or end a run.
    let mut paired = vec![false; changes.len()];
    for first in 0..changes.len() {
        asked.ask();
        for last in first + 1..changes.len().min(first + stack.count / 2 + 1) {
            let usual = usual[first].max(usual[last]);
            // No more can come back than changed.
            if paired[first] || paired[last] || cells[first].min(cells[last]) <= MOST_BACK * usual {
                continue;
            }
            let back = changes[first].undone_by(&changes[last]);
            let (times, share) = (back / usual, back / (cells[first].max(cells[last]) + FLOOR * all));
            if times * share <= MOST_BACK {
                continue;
            }
            (paired[first], paired[last]) = (true, true);
            if last - first >= LEAST_RUN {
                let severe = times > SEVERE.0 && share > SEVERE.1 && back > SEVERE.2 * all;
                let run = first + 1..=last;
                found.extend(run.map(|z| finding(z, Kind::Run, times * share, MOST_BACK, severe)));
            }
        }
    }
    for z in (0..cells.len()).filter(|&z| !paired[z] && cells[z] > LEAST_CHANGE * usual[z]) {
        if let Some([y, x]) = shift(asked, &summaries[z].cells, &summaries[z + 1].cells) {
            let mm = |cells: f64, axis: usize| {
                cells * pixels(stack, axis) as f64 * stack.step_mm / stack.step_px[axis]
            };
            found.push(finding(z + 1, Kind::Shift, mm(y, 0).hypot(mm(x, 1)), CELL_MM, false));
        }
    }
    // One finding of a kind in a slice: that of the greatest change.
    found.sort_by(|a, b| (a.slice, a.kind).cmp(&(b.slice, b.kind)).then(b.measured.total_cmp(&a.measured)));
    found.dedup_by_key(|finding| (finding.slice, finding.kind));
    found
}

/// The shift of a slice along columns and rows, in cells, that leaves little of its change.
fn shift(asked: Asked<'_>, before: &Cells, after: &Cells) -> Option<[f64; 2]> {
    let columns = before.columns;
    let rows = before.tissue.len() / columns;
    if rows.min(columns) <= 2 * REACH {
        return None;
    }
    // Cells that no shift brings in from outside.
    let left = |y: usize, x: usize| {
        let of_row = |r: usize| {
            let own = &before.tissue[r * columns + REACH..(r + 1) * columns - REACH];
            let moved = &after.tissue[(r + y - REACH) * columns + x..][..own.len()];
            own.iter().zip(moved).map(|(a, b)| u16::from(a != b)).sum::<u16>()
        };
        (REACH..rows - REACH).map(|r| usize::from(of_row(r))).sum::<usize>()
    };
    let still = left(REACH, REACH);
    let places = (0..=2 * REACH).flat_map(|y| (0..=2 * REACH).map(move |x| (y, x)));
    let (least, y, x) = places
        .map(|(y, x)| {
            asked.ask_at(y * columns + x);
            (left(y, x), y, x)
        })
        .min()?;
    let is_moved = (y, x) != (REACH, REACH) && (least as f64) < MOST_LEFT * still as f64;
    is_moved.then(|| [y, x].map(|cells| cells as f64 - REACH as f64))
}
