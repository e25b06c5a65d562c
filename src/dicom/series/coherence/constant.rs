//! Rows of one value at the ends of a slice, and slices that are there twice.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};

use super::limit::usual;
use super::{AROUND, BETWEEN, Finding, Kind, SEEN, Stack, Summary, around};
use crate::observer::stop::Asked;

/// Share of the rows that may be constant in one slice alone, beyond twice what is usual.
const SHARE: f64 = 1.0 / 64.0;
/// Rows that may at least.
const LEAST: f64 = 4.0;

/// One in so many pixels is soft tissue in a slice whose noise is looked at.
const LEAST_SOFT: usize = 50;
/// One in so many of them differs from the one beside it: 0.27 of a head in 8 bits, 0.95 of others.
const LEAST_DIFFER: usize = 5;

/// Rows of one value at the beginning and at the end of a slice.
pub(super) struct Ends {
    rows: [usize; 2],
    /// Whether the whole slice has one value.
    pub(super) all: bool,
}

impl Ends {
    pub(super) fn of(slice: &[i16], columns: usize) -> Self {
        let is_constant = |row: &&[i16]| row.iter().all(|v| *v == row[0]);
        let rows = || slice.chunks_exact(columns);
        let begin = rows().take_while(is_constant).count();
        let end = rows().rev().take_while(is_constant).count();
        Self { rows: [begin, end], all: begin * columns >= slice.len() }
    }
}

pub(super) fn find(asked: Asked<'_>, stack: &Stack<'_>, summaries: &[Summary]) -> Vec<Finding> {
    let mut found = repeated(asked, stack, summaries);
    for end in [0, 1] {
        for distances in AROUND {
            let beyond = |z: usize| {
                let (a, b) = around(z, distances, stack.count)?;
                let [own, a, b] = [z, a, b].map(|z| summaries[z].ends.rows[end]);
                (!summaries[z].ends.all).then(|| own.saturating_sub(a.max(b)))
            };
            let beyond: Vec<Option<usize>> = (0..stack.count).map(beyond).collect();
            let apart = distances.0.max(distances.1) as f64;
            let limit = apart * LEAST.max(SHARE * stack.rows as f64)
                + 2.0 * usual(beyond.iter().flatten().map(|rows| *rows as f64));
            for (slice, rows) in beyond.iter().enumerate() {
                let Some(rows) = rows.filter(|rows| *rows as f64 > limit) else { continue };
                if found.iter().any(|f: &Finding| f.slice == slice && f.kind == Kind::Constant) {
                    continue;
                }
                let own = summaries[slice].ends.rows[end];
                let place = if end == 0 { 0..own } else { stack.rows - own..stack.rows };
                let measured = rows as f64;
                found.push(Finding {
                    slice,
                    kind: Kind::Constant,
                    rows: place,
                    measured,
                    limit,
                    severe: false,
                });
            }
        }
    }
    found
}

/// Whether many pixels of soft tissue differ from the one beside them.
fn is_noisy(slice: &[i16]) -> bool {
    let soft = |v: i16| v > BETWEEN && v < SEEN.1;
    let pairs = slice.windows(2).filter(|two| soft(two[0]) && soft(two[1]));
    let (soft, differ) = pairs.fold((0, 0), |(n, d), two| (n + 1, d + usize::from(two[0] != two[1])));
    soft > slice.len() / LEAST_SOFT && differ > soft / LEAST_DIFFER
}

/// Slices with the same pixels as another one. Those without noise may be: they show air alone, or were
/// drawn.
fn repeated(asked: Asked<'_>, stack: &Stack<'_>, summaries: &[Summary]) -> Vec<Finding> {
    // What is the same in slices whose pixels are.
    let hash = |summary: &Summary| {
        asked.ask();
        let mut hasher = DefaultHasher::new();
        (&summary.jumps, &summary.blocks, &summary.tissue).hash(&mut hasher);
        hasher.finish()
    };
    let mut by_hash: HashMap<u64, Vec<usize>> = HashMap::new();
    for (z, summary) in summaries.iter().enumerate().filter(|(_, s)| !s.ends.all) {
        by_hash.entry(hash(summary)).or_default().push(z);
    }
    let alike = |all: &&Vec<usize>| {
        if all.len() < 2 {
            return false;
        }
        asked.ask();
        let first = stack.slice(all[0]);
        let is_first = |&z: &usize| {
            asked.ask();
            stack.slice(z) == first
        };
        is_noisy(&first) && all.iter().all(is_first)
    };
    let mut slices: Vec<usize> = by_hash.values().filter(alike).flatten().copied().collect();
    slices.sort_unstable();
    let finding = |slice| Finding {
        slice,
        kind: Kind::Repeated,
        rows: 0..stack.rows,
        measured: stack.pixels(),
        limit: 0.0,
        severe: false,
    };
    slices.into_iter().map(finding).collect()
}
