//! Patches of values that the slices before and after have nowhere near, and texture that goes a little
//! beyond all of theirs in many places.

use rayon::prelude::*;

use super::limit::usual;
use super::{Finding, Kind, SEEN, Stack, Summary, around};

/// Side of a block in slice steps: what the patient shows in a slice, its neighbours show within one to
/// two blocks.
const SIDE: f64 = 1.5;
/// Pixels of a block's side at least.
const LEAST_SIDE: usize = 4;
/// A value this far from all near it in both neighbours is unexplained, HU: a third of the step from
/// air to tissue.
const FAR: i16 = 300;
/// Connected unexplained pixels that may be at least, beyond a block: 8 of a human head, 162 of a dry
/// skull in 5 mm slices with blocks of 289.
const LEAST: f64 = 32.0;

/// Blocks whose values reach over less than this, HU, hold no border of air and tissue: there a value is
/// odd that lies beyond them by half of that again, 6 standard deviations of noise in all, or by
/// [`LEAST_ODD`].
const FLAT: i16 = 500;
/// HU: less moves no skin.
const LEAST_ODD: i16 = 30;
/// Share of the pixels, beyond twice what is usual, that may be odd: 0.008 in a slice of foam, 0.004 of
/// others.
const ODD_SHARE: f64 = 0.01;

/// Lowest and highest value in blocks of pixels, and the blocks next to them.
pub(super) struct Blocks {
    side: usize,
    across: usize,
    /// Of each block, and its neighbours: clamped to [`SEEN`].
    range: Vec<(i16, i16)>,
}

impl Blocks {
    pub(super) fn of(slice: &[i16], stack: &Stack<'_>) -> Self {
        let coarser = stack.step_px[0].max(stack.step_px[1]);
        let side = ((SIDE * coarser).ceil() as usize).max(LEAST_SIDE);
        let (across, down) = (stack.columns.div_ceil(side), stack.rows.div_ceil(side));
        let mut own = vec![(SEEN.1, SEEN.0); across * down];
        for (r, row) in slice.chunks_exact(stack.columns).enumerate() {
            let blocks = &mut own[r / side * across..(r / side + 1) * across];
            for (block, part) in blocks.iter_mut().zip(row.chunks(side)) {
                let (low, high) = part.iter().fold((i16::MAX, i16::MIN), |(l, h), &v| (l.min(v), h.max(v)));
                *block = (block.0.min(low.max(SEEN.0)), block.1.max(high.min(SEEN.1)));
            }
        }
        let with_next = |i: usize| {
            let (x, y) = (i % across, i / across);
            let rows = y.saturating_sub(1)..down.min(y + 2);
            let near =
                rows.flat_map(|y| (x.saturating_sub(1)..across.min(x + 2)).map(move |x| y * across + x));
            near.fold(own[i], |range, j| wider(range, own[j]))
        };
        Self { side, across, range: (0..own.len()).map(with_next).collect() }
    }
}

fn wider(a: (i16, i16), b: (i16, i16)) -> (i16, i16) {
    (a.0.min(b.0), a.1.max(b.1))
}

pub(super) fn find(stack: &Stack<'_>, summaries: &[Summary]) -> Vec<Finding> {
    let largest: Vec<Patch> = (0..stack.count)
        .into_par_iter()
        .map(|z| {
            around(z, (1, 1), stack.count).map_or_else(Patch::default, |(a, b)| {
                unexplained(stack, &stack.slice(z), &summaries[a].blocks, &summaries[b].blocks)
            })
        })
        .collect();
    let side = summaries.first().map_or(1, |summary| summary.blocks.side);
    let limit = LEAST.max((side * side) as f64) + 2.0 * usual(largest.iter().map(|p| p.pixels as f64));
    let odd_limit = ODD_SHARE * stack.pixels() + 2.0 * usual(largest.iter().map(|p| p.odd as f64));
    let finding = |slice, kind, rows, measured: usize, limit| {
        let measured = measured as f64;
        (measured > limit).then_some(Finding { slice, kind, rows, measured, limit, severe: false })
    };
    let of = |(slice, patch): (usize, &Patch)| {
        let rows = patch.first..patch.last + 1;
        let texture = finding(slice, Kind::Texture, 0..stack.rows, patch.odd, odd_limit);
        finding(slice, Kind::Patch, rows, patch.pixels, limit).into_iter().chain(texture)
    };
    largest.iter().enumerate().flat_map(of).collect()
}

/// Connected unexplained pixels and the rows that they lie in, and how many pixels of the slice are odd.
#[derive(Default, Clone)]
struct Patch {
    odd: usize,
    pixels: usize,
    first: usize,
    last: usize,
}

/// The largest patch of unexplained pixels, connected by their sides.
fn unexplained(stack: &Stack<'_>, slice: &[i16], before: &Blocks, after: &Blocks) -> Patch {
    let side = before.side;
    let mut odd = 0;
    let mut open = Vec::new();
    let mut is_open = vec![false; slice.len()];
    for (r, row) in slice.chunks_exact(stack.columns).enumerate() {
        let first = r / side * before.across;
        for (b, part) in row.chunks(side).enumerate() {
            let (low, high) = wider(before.range[first + b], after.range[first + b]);
            let beyond = |v: i16, by: i16| {
                let seen = v.clamp(SEEN.0, SEEN.1);
                seen < low - by || seen > high + by
            };
            if high - low < FLAT {
                let slack = ((high - low) / 2).max(LEAST_ODD);
                odd += part.iter().filter(|v| beyond(**v, slack)).count();
            }
            let far = |v: i16| beyond(v, FAR);
            for (c, _) in part.iter().enumerate().filter(|(_, v)| far(**v)) {
                let i = r * stack.columns + b * side + c;
                is_open[i] = true;
                open.push(i);
            }
        }
    }
    let mut largest = Patch::default();
    let mut front = Vec::new();
    for i in open {
        if !std::mem::take(&mut is_open[i]) {
            continue;
        }
        front.push(i);
        let mut patch = Patch { odd: 0, pixels: 0, first: i / stack.columns, last: 0 };
        while let Some(i) = front.pop() {
            let c = i % stack.columns;
            patch.pixels += 1;
            patch.first = patch.first.min(i / stack.columns);
            patch.last = patch.last.max(i / stack.columns);
            let sides = [
                (c > 0, i.wrapping_sub(1)),
                (c + 1 < stack.columns, i + 1),
                (true, i.wrapping_sub(stack.columns)),
                (true, i + stack.columns),
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
    largest.odd = odd;
    largest
}
