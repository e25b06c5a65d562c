//! Slices in order along their normal, and whether all are there.

use super::ignored::{self, Ignored};
use super::slice::Slice;
use super::{SeriesError, Warning, WarningCode};
use crate::dicom::series::UnfitReason;
use crate::geometry::{Vec3, cross, dot, norm, sub};

/// Slices nearer than this along the normal are at one position, mm.
const SAME_POSITION: f64 = 0.01;
/// Steps that differ less than this part of the smaller one, or than [`SAME_STEP_MM`], are equal.
const SAME_STEP: f64 = 0.05;
const SAME_STEP_MM: f64 = 0.02;
/// A step counts as that of a missing slice from this multiple of its neighbours on.
const GAP: f64 = 1.5;
/// How near a multiple of a step must be to a whole number.
const WHOLE: f64 = 0.1;
/// Longest run of wide steps that is taken for missing slices at an end of the stack, or that
/// need not be a whole multiple: longer ones are a protocol with two spacings.
const FEW: usize = 2;
/// Steps wider than this give a coarse surface, mm.
const THICK: f64 = 3.0;
/// Neighbours farther apart than this along the normal make no volume, mm: the nose of an adult is about
/// 50 mm high (Farkas, Anthropometry of the Head and Face, 1994), no more than two such steps.
const FARTHEST_APART: f64 = 20.0;
/// Tilt below this is rounding, degrees.
const NO_TILT: f64 = 0.05;

/// Groups of slices at one position, in a stack sorted along `normal`.
pub(super) fn at_one_position(slices: &[Slice], normal: Vec3) -> Vec<std::ops::Range<usize>> {
    let mut groups: Vec<std::ops::Range<usize>> = Vec::new();
    for index in 0..slices.len() {
        match groups.last_mut() {
            Some(group)
                if slices[index].along(normal) - slices[group.start].along(normal) < SAME_POSITION =>
            {
                group.end = index + 1;
            }
            _ => groups.push(index..index + 1),
        }
    }
    groups
}

/// Sorts along `normal`; of the same instance given twice, the first stays in front.
pub(super) fn sort(slices: &mut [Slice], normal: Vec3) {
    slices.sort_by(|a, b| {
        a.along(normal)
            .total_cmp(&b.along(normal))
            .then_with(|| a.sop_instance_uid.cmp(&b.sop_instance_uid))
            .then_with(|| a.frame_index.cmp(&b.frame_index))
            .then_with(|| a.source.cmp(&b.source))
    });
}

/// Equal steps that follow one another.
struct Run {
    step: f64,
    first: usize,
    count: usize,
}

fn runs(steps: &[f64]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (index, &step) in steps.iter().enumerate() {
        match runs.last_mut() {
            Some(run) if (run.step - step).abs() <= SAME_STEP_MM.max(SAME_STEP * run.step.min(step)) => {
                run.count += 1
            }
            _ => runs.push(Run { step, first: index, count: 1 }),
        }
    }
    runs
}

/// Refuses a sorted stack from which slices are missing.
///
/// Spacing may vary: each slice is used at its own position. But steps that stand out from the
/// steps on both sides of them are a hole: one or two steps of 1.5 times both neighbours or more,
/// or any number of steps that are a whole multiple of both. At the end of the stack, where there
/// is one neighbour only, one or two steps that are a whole multiple of it.
pub(super) fn missing(slices: &[Slice], normal: Vec3, ignored: &[Ignored]) -> Result<(), SeriesError> {
    let steps: Vec<f64> =
        slices.windows(2).map(|pair| pair[1].along(normal) - pair[0].along(normal)).collect();
    let runs = runs(&steps);
    for (index, run) in runs.iter().enumerate() {
        let neighbours: Vec<f64> = [index.checked_sub(1), Some(index + 1)]
            .into_iter()
            .flatten()
            .filter_map(|neighbour| runs.get(neighbour).map(|run| run.step))
            .collect();
        let wide = neighbours.iter().all(|step| run.step >= GAP * step);
        let whole = neighbours.iter().all(|step| is_whole_multiple(run.step / step));
        let is_gap = match neighbours.len() {
            0 => false,
            1 => wide && whole && run.count <= FEW,
            _ => wide && (whole || run.count <= FEW),
        };
        if is_gap {
            let around = &slices[run.first..=run.first + run.count];
            return Err(gap(run.step, neighbours[0], around, normal, ignored));
        }
    }
    Ok(())
}

/// Refuses a sorted stack in which an instance that can't be used lies where a slice of its own should:
/// also where so many can't that the steps look regular.
pub(super) fn unusable(slices: &[Slice], normal: Vec3, ignored: &[Ignored]) -> Result<(), SeriesError> {
    let mut within: Vec<Ignored> = Vec::new();
    for one in ignored {
        if slices.windows(2).any(|pair| one.stands_between(&pair[0], &pair[1], normal)) {
            within.push(one.clone());
        }
    }
    if within.is_empty() {
        return Ok(());
    }
    let detail = format!(
        "slices are missing: instances that can't be used as slices lie where slices must ({}); send the original \
         images",
        ignored::counted(&within)
    );
    let all_without_pixels = within.iter().all(|one| one.instance.reason == UnfitReason::NoPixelData);
    let code = if all_without_pixels { "no_pixel_data" } else { "missing_slice" };
    let mut named: Vec<_> = within.into_iter().map(|one| one.instance.sop_instance_uid).collect();
    named.sort();
    named.dedup();
    Err(SeriesError::new(code, detail, named))
}

/// Refuses a sorted stack of which neighbours lie so far apart that what is between them is not known.
pub(super) fn too_far_apart(slices: &[Slice], normal: Vec3) -> Result<(), SeriesError> {
    let step = |pair: &[Slice]| pair[1].along(normal) - pair[0].along(normal);
    let far: Vec<&[Slice]> = slices.windows(2).filter(|pair| step(pair) > FARTHEST_APART).collect();
    if far.is_empty() {
        return Ok(());
    }
    let most = far.iter().map(|pair| step(pair)).fold(0.0, f64::max);
    let around: Vec<Slice> = far.iter().flat_map(|pair| pair.iter().cloned()).collect();
    Err(SeriesError::new(
        "slices_too_far_apart",
        format!(
            "neighbouring slices lie up to {most:.3} mm apart, more than the {FARTHEST_APART} mm between which a \
             surface can be told; send the series with all its slices (those named lie around the wide steps)"
        ),
        super::check::named(&around, |_| true),
    ))
}

/// The error of a gap between slices: of what lies in it, or of what lies around it.
fn gap(step: f64, usual: f64, around: &[Slice], normal: Vec3, ignored: &[Ignored]) -> SeriesError {
    let ends = around.first().zip(around.last());
    let (from, to) = ends.map_or((0.0, 0.0), |(first, last)| (first.along(normal), last.along(normal)));
    let within: Vec<Ignored> =
        ignored.iter().filter(|one| one.lies_between(from, to, normal)).cloned().collect();
    let uids = |of: UnfitReason| {
        let of = within.iter().filter(|one| one.instance.reason == of);
        of.map(|one| one.instance.sop_instance_uid.clone()).collect::<Vec<_>>()
    };
    let mut without_pixels = uids(UnfitReason::NoPixelData);
    if !without_pixels.is_empty() {
        without_pixels.sort();
        let detail = "slices have no pixel data; send them whole";
        return SeriesError::new("no_pixel_data", detail, without_pixels);
    }
    let mut detail = format!(
        "slices are missing: a step of {step:.3} mm stands among steps of {usual:.3} mm; send the whole series (the \
         instances named are those around the gap"
    );
    if !within.is_empty() {
        detail.push_str(&format!(", and those in it that are no slices: {}", ignored::counted(&within)));
    }
    detail.push(')');
    let mut named = super::check::named(around, |_| true);
    named.extend(within.into_iter().map(|one| one.instance.sop_instance_uid));
    named.sort();
    named.dedup();
    SeriesError::new("missing_slice", detail, named)
}

fn is_whole_multiple(ratio: f64) -> bool {
    let whole = ratio.round();
    whole >= 2.0 && (ratio - whole).abs() <= WHOLE * whole.min(3.0)
}

/// Warns of instances that are numbered from head to feet. The stack is sorted from the head down.
pub(super) fn warn_of_descending(slices: &[Slice], warnings: &mut Vec<Warning>) {
    let numbers: Option<Vec<_>> = slices.iter().map(|slice| slice.number).collect();
    if numbers.is_some_and(|numbers| numbers.is_sorted_by(|a, b| a < b)) {
        warnings.push(Warning::new(WarningCode::Descending, "the instances are numbered from head to feet"));
    }
}

/// Warns of tilt, of variable and of thick spacing. The stack is sorted along `normal`.
pub(super) fn warn(slices: &[Slice], normal: Vec3, warnings: &mut Vec<Warning>) {
    let (Some(first), Some(last)) = (slices.first(), slices.last()) else { return };
    let whole = sub(last.geometry().position, first.geometry().position);
    let tilt = norm(cross(whole, normal)).atan2(dot(whole, normal)).to_degrees();
    if tilt > NO_TILT {
        warnings.push(Warning::new(
            WarningCode::GantryTilt,
            format!("the slices are sheared by {tilt:.2} degrees against their normal (by their positions)"),
        ));
    }
    let steps: Vec<f64> =
        slices.windows(2).map(|pair| pair[1].along(normal) - pair[0].along(normal)).collect();
    let least = steps.iter().copied().fold(f64::INFINITY, f64::min);
    let most = steps.iter().copied().fold(0.0, f64::max);
    if runs(&steps).len() > 1 {
        warnings.push(Warning::new(
            WarningCode::VariableSpacing,
            format!("the steps between slices vary from {least:.3} to {most:.3} mm"),
        ));
    }
    if most > THICK {
        warnings.push(Warning::new(
            WarningCode::ThickSlices,
            format!("slices lie up to {most:.3} mm apart: the surface between them is coarse"),
        ));
    }
}
