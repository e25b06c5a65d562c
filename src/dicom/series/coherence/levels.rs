//! The level of air and of soft tissue in bands of rows, against the slices before and after.

use rayon::prelude::*;

use super::limit::usual;
use super::{Finding, Kind, Stack, around};

/// Bands of rows of an image.
const BANDS: usize = 16;
/// Rows of a band at least.
const LEAST_ROWS: usize = 4;
/// Columns that are looked at, about.
const COLUMNS: usize = 256;
/// Shares of a band's pixels that must be air, or soft tissue, in both neighbours.
const LEAST_SHARES: [f64; 2] = [1.0 / 32.0, 1.0 / 8.0];
/// Air lies below this, HU.
const AIR: i16 = -700;
/// Soft tissue lies between these, HU.
const SOFT: (i16, i16) = (-200, 300);
/// A shift of either level by this, HU, beyond what is usual, moves a border of air and tissue by less
/// than a seventh of its edge's width.
const LEAST: f64 = 150.0;
/// Air may be off by anything; soft tissue that is off by more than this, HU, is bone or air that lies in one slice alone.
const MOST: [i32; 2] = [i32::MAX, 300];
/// Air at a level as far off as this, HU, is none.
const SEVERE: f64 = 500.0;
/// Bands that make it severe.
const SEVERE_BANDS: usize = 2;

/// Around one slice and around two.
const AROUND: [(usize, usize); 3] = [(1, 1), (1, 2), (2, 1)];

pub(super) fn find(stack: &Stack<'_>) -> Vec<Finding> {
    let height = (stack.rows / BANDS).max(LEAST_ROWS);
    let mut found: Vec<Finding> = Vec::new();
    for distances in AROUND {
        let shifts: Vec<Option<Vec<[f64; 2]>>> = (0..stack.count)
            .into_par_iter()
            .map(|z| around(z, distances, stack.count).map(|(a, b)| of_bands(stack, [z, a, b], height)))
            .collect();
        for (class, kind) in [Kind::Air, Kind::Tissue].into_iter().enumerate() {
            let most = |bands: &Vec<[f64; 2]>| bands.iter().map(|b| b[class]).fold(0.0, f64::max);
            let limit = LEAST + 2.0 * usual(shifts.iter().flatten().map(most));
            for (slice, bands) in shifts.iter().enumerate() {
                let Some(bands) = bands else { continue };
                let over: Vec<usize> = (0..bands.len()).filter(|&b| bands[b][class] > limit).collect();
                let (Some(&first), Some(&last)) = (over.first(), over.last()) else { continue };
                if found.iter().any(|f| f.slice == slice && f.kind == kind) {
                    continue;
                }
                let far = over.iter().filter(|&&b| bands[b][class] > limit.max(SEVERE)).count();
                found.push(Finding {
                    slice,
                    kind,
                    rows: first * height..stack.rows.min((last + 1) * height),
                    measured: most(bands),
                    limit,
                    severe: kind == Kind::Air && far >= SEVERE_BANDS,
                });
            }
        }
    }
    found
}

/// For each band how far air and soft tissue lie beyond both neighbours, HU.
fn of_bands(stack: &Stack<'_>, slices: [usize; 3], height: usize) -> Vec<[f64; 2]> {
    let [own, before, after] = slices.map(|z| stack.slice(z));
    let step = (stack.columns / COLUMNS).max(1);
    let size = height * stack.columns;
    let least = LEAST_SHARES.map(|share| share * (size / step) as f64);
    let bands = own.chunks(size).zip(before.chunks(size)).zip(after.chunks(size));
    bands
        .map(|((own, before), after)| {
            let mut seen = [0_usize; 2];
            let mut beyond: [Vec<i32>; 2] = [Vec::new(), Vec::new()];
            for i in (0..own.len()).step_by(step) {
                let (low, high) = (before[i].min(after[i]), before[i].max(after[i]));
                let class = if high < AIR {
                    0
                } else if low > SOFT.0 && high < SOFT.1 {
                    1
                } else {
                    continue;
                };
                seen[class] += 1;
                let v = own[i];
                if v < low || v > high {
                    beyond[class].push(i32::from(v) - i32::from(v.clamp(low, high)));
                }
            }
            [0, 1].map(|class| {
                let enough = seen[class] > 0 && seen[class] as f64 >= least[class];
                if enough { shift(&beyond[class], seen[class], MOST[class]) } else { 0.0 }
            })
        })
        .collect()
}

/// How far three quarters of `seen` pixels at least, of which these lie beyond both neighbours, lie on
/// one side of them; 0 if three quarters of them do by more than `most`.
fn shift(beyond: &[i32], seen: usize, most: i32) -> f64 {
    let mut one_side: Vec<i32> = beyond.iter().copied().filter(|&v| v > 0).collect();
    if 2 * one_side.len() < beyond.len() {
        one_side = beyond.iter().filter(|&&v| v < 0).map(|v| -v).collect();
    }
    let Some(nearer) = (one_side.len() + seen / 4).checked_sub(seen) else { return 0.0 };
    let rank = nearer.min(one_side.len().saturating_sub(1));
    if one_side.is_empty() {
        return 0.0;
    }
    let low = *one_side.select_nth_unstable(rank).1;
    let rank = one_side.len() * 3 / 4;
    let high = *one_side.select_nth_unstable(rank).1;
    if high > most { 0.0 } else { f64::from(low) }
}
