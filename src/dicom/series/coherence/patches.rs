//! Patches of values that the slices before and after have nowhere near.

use super::limit::usual;
use super::{Finding, Kind, SEEN, Stack, Summary};

/// Side of a block in slice steps: what the patient shows in a slice, its neighbours show within one to
/// two blocks.
const SIDE: f64 = 1.5;
/// Pixels of a block's side at least.
const LEAST_SIDE: usize = 4;
/// A value this far from all near it in both neighbours is unexplained, HU: a third of the step from
/// air to tissue.
const FAR: i16 = 300;
/// Connected unexplained pixels that may be at least.
const LEAST: f64 = 32.0;
/// A flat hollow or bulge shows in one slice alone over an area that grows with the fourth power of the
/// slices' distance, square millimetres for a distance of 1 mm: 1.7 at most of a mouth that is
/// sampled every 2.5, 3.75 and 5 mm.
const LEAST_MM2: f64 = 2.5;

/// Lowest and highest value in blocks of pixels, and the blocks next to them, clamped to [`SEEN`].
#[derive(Hash)]
pub(super) struct Blocks {
    side: usize,
    across: usize,
    lows: Vec<i16>,
    highs: Vec<i16>,
}

impl Blocks {
    pub(super) fn of(slice: &[i16], stack: &Stack<'_>) -> Self {
        let coarser = stack.step_px[0].max(stack.step_px[1]);
        let side = ((SIDE * coarser).ceil() as usize).max(LEAST_SIDE);
        let across = stack.columns.div_ceil(side);
        let (mut lows, mut highs) = (Vec::new(), Vec::new());
        for rows in slice.chunks(side * stack.columns) {
            let (first, rows) = rows.split_at(stack.columns);
            let (mut low, mut high) = (first.to_vec(), first.to_vec());
            for row in rows.chunks_exact(stack.columns) {
                low.iter_mut().zip(row).for_each(|(low, v)| *low = (*low).min(*v));
                high.iter_mut().zip(row).for_each(|(high, v)| *high = (*high).max(*v));
            }
            let seen = |v: Option<i16>| v.unwrap_or(0).clamp(SEEN.0, SEEN.1);
            lows.extend(low.chunks(side).map(|part| seen(part.iter().copied().min())));
            highs.extend(high.chunks(side).map(|part| seen(part.iter().copied().max())));
        }
        Self {
            side,
            across,
            lows: with_next(&lows, across, i16::min),
            highs: with_next(&highs, across, i16::max),
        }
    }
}

/// The lowest or highest of each block and those next to it.
fn with_next(own: &[i16], across: usize, of: impl Fn(i16, i16) -> i16 + Copy) -> Vec<i16> {
    let mut beside = own.to_vec();
    for (beside, own) in beside.chunks_exact_mut(across).zip(own.chunks_exact(across)) {
        beside[1..].iter_mut().zip(own).for_each(|(v, left)| *v = of(*v, *left));
        beside.iter_mut().zip(&own[1..]).for_each(|(v, right)| *v = of(*v, *right));
    }
    let mut all = beside.clone();
    all[across..].iter_mut().zip(&beside).for_each(|(v, above)| *v = of(*v, *above));
    all.iter_mut().zip(&beside[across..]).for_each(|(v, below)| *v = of(*v, *below));
    all
}

/// The findings among the largest patches of all slices.
pub(super) fn find(stack: &Stack<'_>, summaries: &[Summary], largest: &[Patch]) -> Vec<Finding> {
    let side = summaries.first().map_or(1, |summary| summary.blocks.side);
    let least = stack.pixels_of(LEAST_MM2 * stack.step_mm.powi(4)).max((side * side) as f64).max(LEAST);
    let limit = least + 2.0 * usual(largest.iter().map(|p| p.pixels as f64));
    let over = |(_, patch): &(usize, &Patch)| patch.pixels as f64 > limit;
    let finding = |(slice, patch): (usize, &Patch)| Finding {
        slice,
        kind: Kind::Patch,
        rows: patch.first..patch.last + 1,
        measured: patch.pixels as f64,
        limit,
        severe: false,
    };
    largest.iter().enumerate().filter(over).map(finding).collect()
}

/// Connected unexplained pixels and the rows that they lie in.
#[derive(Debug, Default, Clone)]
pub(super) struct Patch {
    pixels: usize,
    first: usize,
    last: usize,
}

/// The largest patch of pixels that neither neighbour explains, connected by their sides.
pub(super) fn unexplained(slice: &[i16], columns: usize, before: &Blocks, after: &Blocks) -> Patch {
    let Blocks { side, across, .. } = *before;
    let mut open = Vec::new();
    // The lowest and the highest explained value of each column in a row of blocks.
    let (mut lowest, mut highest) = (vec![0; columns], vec![0; columns]);
    for (y, rows) in slice.chunks(side * columns).enumerate() {
        for (x, (lowest, highest)) in lowest.chunks_mut(side).zip(highest.chunks_mut(side)).enumerate() {
            let b = y * across + x;
            let (low, high) =
                (before.lows[b].min(after.lows[b]) - FAR, before.highs[b].max(after.highs[b]) + FAR);
            // Beyond what is seen nothing lies.
            lowest.fill(if low <= SEEN.0 { i16::MIN } else { low });
            highest.fill(if high >= SEEN.1 { i16::MAX } else { high });
        }
        for (r, row) in rows.chunks_exact(columns).enumerate() {
            let explained = row.iter().zip(&lowest).zip(&highest);
            let any = explained
                .clone()
                .fold(0, |any, ((v, low), high)| any | u16::from(v < low) | u16::from(v > high));
            if any != 0 {
                let first = (y * side + r) * columns;
                let far = explained.enumerate().filter(|(_, ((v, low), high))| v < low || v > high);
                open.extend(far.map(|(c, _)| first + c));
            }
        }
    }
    largest(open, slice.len(), columns)
}

fn largest(open: Vec<usize>, pixels: usize, columns: usize) -> Patch {
    let mut largest = Patch::default();
    if open.is_empty() {
        return largest;
    }
    let mut is_open = vec![false; pixels];
    open.iter().for_each(|&i| is_open[i] = true);
    let mut front = Vec::new();
    for i in open {
        if !std::mem::take(&mut is_open[i]) {
            continue;
        }
        front.push(i);
        let mut patch = Patch { pixels: 0, first: i / columns, last: 0 };
        while let Some(i) = front.pop() {
            let (r, c) = (i / columns, i % columns);
            patch.pixels += 1;
            patch.first = patch.first.min(r);
            patch.last = patch.last.max(r);
            let sides = [
                (c > 0, i.wrapping_sub(1)),
                (c + 1 < columns, i + 1),
                (true, i.wrapping_sub(columns)),
                (true, i + columns),
            ];
            for (_, j) in sides.into_iter().filter(|(is_in, _)| *is_in) {
                if is_open.get_mut(j).is_some_and(std::mem::take) {
                    front.push(j);
                }
            }
        }
        if patch.pixels > largest.pixels {
            largest = patch;
        }
    }
    largest
}
