//! Row boundaries across which much changes: rows lost, filled, shifted or decoded from a wrong state
//! begin and end with a row, and their neighbours in the other slices don't.

use rayon::prelude::*;

use super::limit::usual;
use super::{AROUND, Finding, Kind, MUCH, SEEN, Stack, Summary, around};
use crate::observer::stop::Asked;

/// A boundary in the patient moves by less than this many slice steps along the rows from one slice to
/// the next: a surface within 18 degrees of the slices' plane is tissue that begins with the slice.
const SLOPE: f64 = 3.0;
/// Rows that it may move at least.
const LEAST_ROWS: usize = 4;
/// Share of the columns, beyond twice what is usual, that may change at once in one slice alone: at most
/// 0.06 in scans of heads and skulls.
const SHARE: f64 = 0.1;
/// Columns that may at least: pads beside a head in 128 columns reach 14 beyond the share.
const LEAST: f64 = 20.0;
/// The limit around two or three slices, as a multiple: what is in view in three slices only counts there.
const AROUND_MORE: f64 = 1.5;
/// A boundary over this share of the columns, or noise in as many rows, is no patient.
const SEVERE_SHARE: f64 = 0.5;
/// Rows that make it.
const SEVERE_ROWS: usize = 8;

/// For each boundary between two rows the columns in which the value changes [`MUCH`].
pub(super) fn of(slice: &[i16], columns: usize) -> Vec<u32> {
    let much = |(a, b): (&i16, &i16)| {
        let step = a.clamp(&SEEN.0, &SEEN.1) - b.clamp(&SEEN.0, &SEEN.1);
        u16::from(!(-MUCH..=MUCH).contains(&step))
    };
    let (above, below) = (slice.chunks_exact(columns), slice.chunks_exact(columns).skip(1));
    above.zip(below).map(|(above, below)| above.iter().zip(below).map(much).sum::<u16>().into()).collect()
}

pub(super) fn find(asked: Asked<'_>, stack: &Stack<'_>, summaries: &[Summary]) -> Vec<Finding> {
    let reach = ((SLOPE * stack.step_px[0]).ceil() as usize).max(LEAST_ROWS);
    // The highest count near each boundary, by how many slices away the boundary is looked for.
    let highest = |summary: &Summary| {
        [1, 2, 3].map(|d| {
            asked.ask();
            highest_within(&summary.jumps, d * reach)
        })
    };
    let near: Vec<[Vec<u32>; 3]> = summaries.par_iter().panic_fuse().map(highest).collect();
    let mut found: Vec<Finding> = Vec::new();
    for distances in AROUND {
        let beyond: Vec<Option<Vec<u32>>> = (0..stack.count)
            .into_par_iter()
            .panic_fuse()
            .map(|z| {
                asked.ask();
                let far = distances.0.max(distances.1) - 1;
                let own = &summaries[z].jumps;
                // What comes into view at the first or the last rows was beside the image before.
                let inner = reach.min(own.len() / 8)..own.len() - reach.min(own.len() / 8);
                let beyond = |r: usize, neighbours: &[usize]| {
                    if !inner.contains(&r) {
                        return 0;
                    }
                    own[r].saturating_sub(neighbours.iter().map(|&n| near[n][far][r]).max().unwrap_or(0))
                };
                let neighbours = match around(z, distances, stack.count) {
                    Some((a, b)) => vec![a, b],
                    // The first and the last slice have one neighbour.
                    None if distances == (1, 1) => vec![if z == 0 { 1 } else { z - 1 }],
                    None => return None,
                };
                Some((0..own.len()).map(|r| beyond(r, &neighbours)).collect())
            })
            .collect();
        let most = |b: &Vec<u32>| f64::from(b.iter().copied().max().unwrap_or(0));
        let usual = usual(beyond.iter().flatten().map(most));
        let limit = SHARE * stack.columns as f64 + LEAST + 2.0 * usual;
        let limit = if distances == (1, 1) { limit } else { AROUND_MORE * limit };
        for (slice, beyond) in beyond.iter().enumerate() {
            let Some(beyond) = beyond else { continue };
            let over: Vec<usize> = (0..beyond.len()).filter(|&r| f64::from(beyond[r]) > limit).collect();
            let (Some(&first), Some(&last)) = (over.first(), over.last()) else { continue };
            let measured = most(beyond);
            let severe = measured > SEVERE_SHARE * stack.columns as f64 && over.len() >= SEVERE_ROWS;
            // The row below the first boundary up to the row below the last.
            let rows = first + 1..last + 2;
            let finding = Finding { slice, kind: Kind::Jump, rows, measured, limit, severe };
            match found.iter_mut().find(|f| f.slice == slice) {
                Some(known) if known.measured / known.limit >= measured / limit => known.severe |= severe,
                Some(known) => *known = finding,
                None => found.push(finding),
            }
        }
    }
    found
}

fn highest_within(counts: &[u32], reach: usize) -> Vec<u32> {
    let within = |r: usize| &counts[r.saturating_sub(reach)..counts.len().min(r + reach + 1)];
    (0..counts.len()).map(|r| within(r).iter().copied().max().unwrap_or(0)).collect()
}
