//! Slices, or rows of them, that don't go with their neighbours: what damaged or half-decoded data
//! look like after a decoder that noticed nothing.
//!
//! A slice lies between the one before and the one after it, in what it shows and in its levels. Each
//! measure here is how far it does not; each is held against what the other slices of the same series
//! show, so that thick slices, noise, tilt and coarse pixels set their own limits:
//!
//! | measure | file | finds |
//! |---|---|---|
//! | pixels that change between air and tissue and back | [`place`] | a slice of another place, parts lost |
//! | row boundaries across which much changes | [`jumps`] | all that begins or ends with a row |
//! | patches of values that the neighbours have nowhere near | [`patches`] | noise, broken code blocks |
//! | level of air and of soft tissue in a band of rows | [`levels`] | offsets |
//! | levels that change from a slice to the next and stay there | [`steps`] | a wrong rescale in half of the slices |
//! | changes that are undone some slices on, or that a shift explains | [`lasting`] | long runs, a patient who moved |
//! | rows of one value at the ends, pixels there twice | [`constant`] | cut off, filled up, sent twice |
//!
//! Two or three damaged slices side by side are compared with those around them, longer runs found by
//! their first and last slices. The voxels are only looked at.

mod constant;
mod jumps;
mod lasting;
mod levels;
mod limit;
mod patches;
mod place;
mod stack;
mod steps;
mod tell;
#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::ops::Range;

use rayon::prelude::*;

use crate::observer::Observer;
use crate::observer::stop::Asked;

use patches::Patch;
pub(super) use stack::Stack;
pub(super) use steps::Reading;
pub(super) use tell::tell;

/// Fewer slices tell too little of what is usual among them.
const LEAST_SLICES: usize = 8;
/// Smaller matrices hold too few pixels.
const LEAST_SIDE: usize = 48;
/// Between the levels of air (-1000 HU) and of soft tissue (about 40 HU), HU.
const BETWEEN: i16 = -400;
/// Values are clamped to these before they are compared, HU: from air to soft tissue. Bone that
/// begins within a slice is no damage.
const SEEN: (i16, i16) = (-1000, 200);
/// A change of more than this, HU, a third of the step from air to tissue, and more than 4 standard
/// deviations of the difference of two pixels with 70 HU of noise.
const MUCH: i16 = 400;
/// Bytes by which a code block of a JPEG 2000 frame may end off its end: those of 5 encoders are off by 2
/// at most, damaged ones by 12 to thousands.
const MOST_OFF: u32 = 8;
/// Slices that are compared with their neighbours at a time.
const AT_A_TIME: usize = 8;
/// Distances to the neighbours before and after: the next ones, and those around two and three slices.
const AROUND: [(usize, usize); 6] = [(1, 1), (1, 2), (2, 1), (1, 3), (2, 2), (3, 1)];

/// What does not go with the neighbours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    /// Air and tissue lie elsewhere than in the slices before and after.
    Place,
    /// From a slice to another, air and tissue lie elsewhere than before and after.
    Run,
    /// From a slice on all lies aside.
    Shift,
    /// Two slices fit better if exchanged.
    Order,
    /// Something begins or ends with a row.
    Jump,
    /// A patch of values that are nowhere near in the neighbours.
    Patch,
    /// Air at another level.
    Air,
    /// Soft tissue at another level.
    Tissue,
    /// Rows of one value.
    Constant,
    /// The same pixels as another slice.
    Repeated,
    /// A block of the compressed frame does not end with its data.
    Stream,
    /// Air or tissue at another level than in the other slices, from a slice to the next and on.
    Step,
}

/// One slice and what was found in it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Finding {
    /// Index in the stack.
    pub(super) slice: usize,
    pub(super) kind: Kind,
    /// Rows of the image that it was found in, counted from 0.
    pub(super) rows: Range<usize>,
    /// Share of the ordinary change (`Place`, `Run`, `Order`), mm (`Shift`), columns (`Jump`), pixels (`Patch`),
    /// HU (`Air`, `Tissue`, `Step`), rows (`Constant`), pixels (`Repeated`), bytes (`Stream`).
    pub(super) measured: f64,
    /// The most that the series itself allows, in the same unit.
    pub(super) limit: f64,
    /// Whether no scan of a patient comes near it.
    pub(super) severe: bool,
}

/// What one slice tells alone.
struct Summary {
    tissue: Vec<u64>,
    cells: lasting::Cells,
    jumps: Vec<u32>,
    blocks: patches::Blocks,
    ends: constant::Ends,
}

/// Everything in the stack that does not go with its neighbours, and frames whose blocks end off their
/// ends by so many bytes, by slice and kind. If the observer cancels, it unwinds
/// ([`crate::observer::stop`]) or is a part of it.
pub(super) fn findings(
    stack: &Stack<'_>,
    off_their_ends: &[(usize, u32)],
    observer: &dyn Observer,
) -> Vec<Finding> {
    let mut found = between_neighbours(stack, observer);
    found.extend(steps::find(stack, observer));
    found.extend(off_their_ends.iter().filter(|(_, bytes)| *bytes > MOST_OFF).map(|&(slice, bytes)| {
        Finding {
            slice,
            kind: Kind::Stream,
            rows: 0..stack.rows,
            measured: f64::from(bytes),
            limit: f64::from(MOST_OFF),
            severe: false,
        }
    }));
    found.sort_by_key(|finding| (finding.slice, finding.kind));
    found
}

fn between_neighbours(stack: &Stack<'_>, observer: &dyn Observer) -> Vec<Finding> {
    if stack.count < LEAST_SLICES || stack.rows < LEAST_SIDE || stack.columns < LEAST_SIDE {
        return Vec::new();
    }
    let summary = |z| {
        let slice = stack.slice(z);
        (!observer.cancelled()).then(|| Summary {
            tissue: place::tissue(&slice, stack.columns),
            cells: lasting::Cells::of(&slice, stack),
            jumps: jumps::of(&slice, stack.columns),
            blocks: patches::Blocks::of(&slice, stack),
            ends: constant::Ends::of(&slice, stack.columns),
        })
    };
    let summaries: Option<Vec<Summary>> = (0..stack.count).into_par_iter().map(summary).collect();
    let Some(summaries) = summaries else { return Vec::new() };
    // Slices that hold nothing were added at the ends.
    let holds = |summary: &Summary| !summary.ends.all;
    let (Some(first), Some(last)) = (summaries.iter().position(holds), summaries.iter().rposition(holds))
    else {
        return Vec::new();
    };
    let (stack, summaries) = (&stack.part(first..last + 1), &summaries[first..=last]);
    if stack.count < LEAST_SLICES {
        return Vec::new();
    }
    let compared: Option<Vec<Vec<Compared>>> = (0..stack.count.div_ceil(AT_A_TIME))
        .into_par_iter()
        .map(|part| compared(stack, summaries, part * AT_A_TIME, observer))
        .collect();
    let Some(compared) = compared else { return Vec::new() };
    let (patches, shifts): (Vec<Patch>, Vec<_>) = compared.into_iter().flatten().unzip();
    let asked = Asked::of(observer);
    let mut found = place::find(asked, stack, summaries);
    asked.ask();
    found.extend(lasting::find(asked, stack, summaries));
    asked.ask();
    found.extend(jumps::find(asked, stack, summaries));
    asked.ask();
    found.extend(patches::find(stack, summaries, &patches));
    found.extend(levels::find(stack, &shifts));
    asked.ask();
    found.extend(constant::find(asked, stack, summaries));
    for finding in &mut found {
        finding.rows = stack.image_rows(&finding.rows);
        finding.slice += first;
    }
    found
}

/// The largest patch of a slice that its neighbours don't explain, and its shifts against those around it.
type Compared = (Patch, [Option<levels::Shifts>; levels::AROUND.len()]);

/// Slices from `first` on against those around them; `None` if the observer cancels. Some at a time,
/// because each is looked at up to five times.
fn compared(
    stack: &Stack<'_>,
    summaries: &[Summary],
    first: usize,
    observer: &dyn Observer,
) -> Option<Vec<Compared>> {
    let end = stack.count.min(first + AT_A_TIME);
    let begin = first.saturating_sub(2);
    let slices: Vec<Cow<'_, [i16]>> = (begin..stack.count.min(end + 2))
        .map(|z| (!observer.cancelled()).then(|| stack.slice(z)))
        .collect::<Option<_>>()?;
    let of = |z| {
        let slice = |z: usize| &*slices[z - begin];
        let patch = around(z, (1, 1), stack.count).map_or_else(Patch::default, |(a, b)| {
            patches::unexplained(slice(z), stack.columns, &summaries[a].blocks, &summaries[b].blocks)
        });
        let shifts = levels::AROUND.map(|distances| {
            let (a, b) = around(z, distances, stack.count)?;
            Some(levels::of(slice(z), slice(a), slice(b), stack.columns))
        });
        (!observer.cancelled()).then_some((patch, shifts))
    };
    (first..end).map(of).collect()
}

/// The slices `before` and `after` slice `z`, where both are in the stack.
fn around(z: usize, (before, after): (usize, usize), count: usize) -> Option<(usize, usize)> {
    Some((z.checked_sub(before)?, z + after)).filter(|(_, last)| *last < count)
}
