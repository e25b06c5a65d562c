//! Where air and tissue are: pixels that change from one to the other and back.
//!
//! Of three slices a, b, c the pixels in which b differs from both are half of |a≠b| + |b≠c| - |a≠c|.
//! Noise gives few of them; a surface that moves on from slice to slice gives none.

use std::ops::Range;

use super::{AROUND, BETWEEN, Finding, Kind, Stack, Summary, around};
use crate::observer::stop::Asked;

/// Most of the ordinary change between neighbours that may be undone in the next slice: 0.3 at most, of a
/// face that was blanked, 0.43 of a skull in steps of 10 mm; two slices side by side that are exchanged
/// give 0.5, others more.
const MOST_NEXT: f64 = 0.45;
/// The same around two or three slices: what is in view in three slices only counts there.
const MOST_AROUND: f64 = 0.6;
/// The same for the first and last slices, which go on in one direction only: 0.5 if the change goes on
/// as it was.
const MOST_AT_ENDS: f64 = 2.5;
/// Gain in likeness from which two slices count as exchanged: 0.12 at most of slices that differ by noise
/// alone; an exchange of two equal steps gains 0.4.
const MOST_GAIN: f64 = 0.15;
/// The same of three slices in reverse, by what changes at their ends: two thirds of an equal change.
const MOST_GAIN_OF_THREE: f64 = 0.3;
/// A slice that differs by this many ordinary changes, and [this share](SEVERE_SHARE) of its pixels, is
/// of another place.
const SEVERE: f64 = 2.0;
const SEVERE_SHARE: f64 = 0.02;
/// Share of the pixels that may change without a word: 11 x 11 of 512 x 512.
const FLOOR: f64 = 0.0005;
/// The same for a pair that may have been exchanged.
const FLOOR_OF_PAIR: f64 = 0.002;
/// Steps on each side that tell the ordinary change.
const WINDOW: usize = 6;

/// One bit a pixel, each row from a new word on: whether it is tissue.
pub(super) fn tissue(slice: &[i16], columns: usize) -> Vec<u64> {
    let mut of_row = vec![[0_u8; 64]; columns.div_ceil(64)];
    let mut bits = Vec::with_capacity(slice.len() / columns * of_row.len());
    for row in slice.chunks_exact(columns) {
        of_row.as_flattened_mut().iter_mut().zip(row).for_each(|(is, v)| *is = u8::from(*v > BETWEEN));
        bits.extend(of_row.iter().map(word));
    }
    bits
}

/// The bits of 64 bytes of 0 or 1. A product puts those of 8 bytes into its highest one: byte i has been
/// multiplied by 2^(56 - 7 i) there, and no two bits meet.
fn word(bytes: &[u8; 64]) -> u64 {
    let (eights, _) = bytes.as_chunks::<8>();
    let bits = |eight: &[u8; 8]| u64::from_le_bytes(*eight).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    eights.iter().fold(0, |word, eight| word << 8 | bits(eight))
}

fn differ(a: &[u64], b: &[u64]) -> f64 {
    f64::from(a.iter().zip(b).map(|(a, b)| (a ^ b).count_ones()).sum::<u32>())
}

/// Differences of slices that lie 1 to 4 apart.
struct Differences {
    apart: [Vec<f64>; 4],
    /// The middle one of those of slices side by side.
    middle: f64,
}

impl Differences {
    fn between(&self, a: usize, b: usize) -> f64 {
        self.apart[a.abs_diff(b) - 1][a.min(b)]
    }

    /// The ordinary change from one slice to the next near `z`: 40 of 100 are smaller, so that three
    /// damaged slices, which raise six of twelve, don't raise it. At least the middle one of all: where
    /// little changes, a thing that begins is much.
    fn ordinary(&self, z: usize) -> f64 {
        ordinary(&self.apart[0], z).max(self.middle)
    }
}

/// That of which 40 of 100 of the `steps` near `z` are smaller.
pub(super) fn ordinary(steps: &[f64], z: usize) -> f64 {
    let first = z.saturating_sub(WINDOW).min(steps.len().saturating_sub(2 * WINDOW));
    let mut near = steps[first..steps.len().min(first + 2 * WINDOW)].to_vec();
    let rank = near.len() * 4 / 10;
    *near.select_nth_unstable_by(rank, f64::total_cmp).1
}

pub(super) fn find(asked: Asked<'_>, stack: &Stack<'_>, summaries: &[Summary]) -> Vec<Finding> {
    let count = stack.count;
    let apart = |d: usize| {
        let pair = |z: usize| {
            asked.ask();
            differ(&summaries[z].tissue, &summaries[z + d].tissue)
        };
        (0..count.saturating_sub(d)).map(pair).collect::<Vec<f64>>()
    };
    let apart = [apart(1), apart(2), apart(3), apart(4)];
    let mut steps = apart[0].clone();
    let middle = *steps.select_nth_unstable_by(count.saturating_sub(1) / 2, f64::total_cmp).1;
    let differences = Differences { apart, middle };
    let floor = FLOOR * stack.pixels();
    let finding = |slice, kind, rows, measured: f64, limit, pixels: f64| {
        let severe = kind == Kind::Place && measured >= SEVERE && pixels >= SEVERE_SHARE * stack.pixels();
        Finding { slice, kind, rows, measured, limit, severe }
    };
    let mut found = Vec::new();
    for z in 0..count {
        asked.ask_at(z);
        let ordinary = differences.ordinary(z);
        let inner = AROUND.into_iter().filter_map(|distances| {
            let (a, b) = around(z, distances, count)?;
            let limit = if distances == (1, 1) { MOST_NEXT } else { MOST_AROUND };
            Some((a, b, b - a, limit))
        });
        // The first slices, against two that follow: |z≠a| + |z≠b| - |a≠b|.
        let ends = (1..=3).flat_map(|d| {
            let first = (z < d && z + d + 1 < count).then(|| (z + d, z + d + 1));
            let last = (z + d >= count && z > d).then(|| (z - d, z - d - 1));
            first.into_iter().chain(last).map(move |(a, b)| (a, b, 2 * d + 1, MOST_AT_ENDS))
        });
        let worst = inner
            .chain(ends)
            .map(|(a, b, steps, limit)| {
                let odd = differences.between(z, a) + differences.between(z, b) - differences.between(a, b);
                let odd = odd.max(0.0) / 2.0;
                let ordinary = if limit > 1.0 { ordinary.max(differences.between(a, b)) } else { ordinary };
                (odd / (steps as f64 * ordinary + floor), limit, odd, (a, b))
            })
            .filter(|(measured, limit, ..)| measured > limit)
            .max_by(|a, b| (a.0 / a.1).total_cmp(&(b.0 / b.1)));
        if let Some((measured, limit, odd, (a, b))) = worst {
            let rows = odd_rows(stack, summaries, [z, a, b]);
            found.push(finding(z, Kind::Place, rows, measured, limit, odd));
        }
    }
    for z in 1..count.saturating_sub(2) {
        let d = |a, b| differences.between(a, b);
        let as_they_are = d(z - 1, z) + d(z, z + 1) + d(z + 1, z + 2);
        let exchanged = d(z - 1, z + 1) + d(z, z + 1) + d(z, z + 2);
        let gain = (as_they_are - exchanged) / (as_they_are + FLOOR_OF_PAIR * stack.pixels());
        if gain > MOST_GAIN {
            for slice in [z, z + 1] {
                found.push(finding(slice, Kind::Order, 0..stack.rows, gain, MOST_GAIN, 0.0));
            }
        }
    }
    for z in 1..count.saturating_sub(3) {
        let d = |a, b| differences.between(a, b);
        let as_they_are = d(z - 1, z) + d(z + 2, z + 3);
        let reversed = d(z - 1, z + 2) + d(z, z + 3);
        let gain = (as_they_are - reversed) / (as_they_are + FLOOR_OF_PAIR * stack.pixels());
        if gain > MOST_GAIN_OF_THREE {
            for slice in [z, z + 2] {
                found.push(finding(slice, Kind::Order, 0..stack.rows, gain, MOST_GAIN_OF_THREE, 0.0));
            }
        }
    }
    // One finding of a kind in a slice: the first.
    found.sort_by_key(|finding| (finding.slice, finding.kind));
    found.dedup_by_key(|finding| (finding.slice, finding.kind));
    found
}

/// From the first to the last row in which a slice differs from both others.
fn odd_rows(stack: &Stack<'_>, summaries: &[Summary], [z, a, b]: [usize; 3]) -> Range<usize> {
    let words = stack.columns.div_ceil(64);
    let [z, a, b] = [z, a, b].map(|z| &summaries[z].tissue);
    let is_odd = |r: &usize| {
        let odd = |w: usize| ((z[w] ^ a[w]) & (z[w] ^ b[w])).count_ones();
        (r * words..(r + 1) * words).map(odd).sum::<u32>() as usize > stack.columns / 64
    };
    let first = (0..stack.rows).find(is_odd).unwrap_or(0);
    first..(0..stack.rows).rev().find(is_odd).map_or(stack.rows, |last| last + 1)
}
