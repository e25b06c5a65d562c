//! What all slices of a volume must have in common.

use std::ops::RangeInclusive;

use super::frame::{Geometry, Instance, Rescale};
use super::slice::Slice;
use super::{ReadLimits, SeriesError, Warning, WarningCode};
use crate::dicom::uid::SopInstanceUid;
use crate::geometry::Vec3;

/// Most that a component of a direction may differ between slices: 0.03 mm over 300 mm.
const DIRECTION_TOLERANCE: f64 = 1e-4;
/// Most that pixel spacing may differ, as a part of itself: 0.05 mm over 500 mm.
const SPACING_TOLERANCE: f64 = 1e-4;

/// Farthest from the origin of the patient coordinates that a coordinate can be, mm.
const FARTHEST: f64 = 10_000.0;
/// Pixel spacing that a CT can have, mm.
const SPACINGS: RangeInclusive<f64> = 0.01..=10.0;

/// Plausible geometry of every slice, or the error that names those without.
pub(super) fn geometry(slices: &[Slice]) -> Result<(), SeriesError> {
    let without = named(slices, |slice| slice.frame.geometry.is_none());
    if !without.is_empty() {
        return Err(SeriesError::new(
            "missing_geometry",
            "ImagePositionPatient, ImageOrientationPatient or PixelSpacing is missing or not valid; the sender must \
             supply them, the place of the skin can't be known without",
            without,
        ));
    }
    let odd = named(slices, |slice| slice.frame.geometry.is_some_and(|geometry| !is_plausible(&geometry)));
    if !odd.is_empty() {
        return Err(SeriesError::new(
            "implausible_geometry",
            format!(
                "ImagePositionPatient beyond {FARTHEST} mm, or PixelSpacing outside {} to {} mm; the sender must \
                 correct them",
                SPACINGS.start(),
                SPACINGS.end()
            ),
            odd,
        ));
    }
    Ok(())
}

fn is_plausible(geometry: &Geometry) -> bool {
    geometry.position.iter().all(|coordinate| coordinate.abs() <= FARTHEST)
        && SPACINGS.contains(&geometry.row_spacing)
        && SPACINGS.contains(&geometry.column_spacing)
}

/// One frame of reference, one orientation, one matrix, one pixel spacing, one stack.
pub(super) fn consistency(slices: &[Slice]) -> Result<(), SeriesError> {
    let Some(first) = slices.first() else { return Ok(()) };
    let fail = |code, what: &str, differs: &dyn Fn(&Slice) -> bool| {
        let instances = minority(slices, differs);
        if instances.is_empty() {
            return Ok(());
        }
        let detail = format!("{what}; send the slices of one volume as one series");
        Err(SeriesError::new(code, detail, instances))
    };
    fail("mixed_series", "the instances are of different series", &|slice| {
        slice.series_instance_uid != first.series_instance_uid
    })?;
    fail("mixed_frame_of_reference", "the slices are in different frames of reference", &|slice| {
        slice.frame_of_reference_uid != first.frame_of_reference_uid
    })?;
    let geometry = |slice: &Slice| slice.frame.geometry;
    let differs = |differ: fn(&Geometry, &Geometry) -> bool| {
        move |slice: &Slice| match (geometry(slice), geometry(first)) {
            (Some(a), Some(b)) => differ(&a, &b),
            _ => false,
        }
    };
    fail(
        "mixed_orientation",
        "the slices have different orientations",
        &differs(|a, b| {
            directions_differ(a.along_row, b.along_row) || directions_differ(a.down_column, b.down_column)
        }),
    )?;
    fail("mixed_matrix", "the slices have different numbers of rows or columns", &|slice| {
        slice.matrix != first.matrix
    })?;
    fail(
        "mixed_pixel_spacing",
        "the slices have different pixel spacing",
        &differs(|a, b| {
            spacings_differ(a.row_spacing, b.row_spacing)
                || spacings_differ(a.column_spacing, b.column_spacing)
        }),
    )?;
    fail("several_stacks", "the frames belong to different stacks", &|slice| {
        slice.frame.stack_id != first.frame.stack_id
    })
}

/// A rescale to Hounsfield units for every slice.
pub(super) fn rescale(slices: &[Slice]) -> Result<(), SeriesError> {
    let other = named(slices, |slice| slice.frame.other_unit.is_some());
    if let Some(unit) = slices.iter().find_map(|slice| slice.frame.other_unit) {
        return Err(SeriesError::new(
            "no_rescale",
            format!(
                "RescaleType (0028,1054) says that the values are {unit}, not Hounsfield units (HU); send the CT image \
                 itself"
            ),
            other,
        ));
    }
    let without = named(slices, |slice| slice.frame.rescale.is_none());
    if without.is_empty() {
        return Ok(());
    }
    Err(SeriesError::new(
        "no_rescale",
        "RescaleSlope and RescaleIntercept to Hounsfield units are missing or not valid; the sender must supply them",
        without,
    ))
}

/// Gray values, as far as Photometric Interpretation tells.
pub(super) fn photometric(slices: &[Slice]) -> Result<(), SeriesError> {
    let is_gray = |slice: &Slice| matches!(slice.photometric.as_deref(), Some("MONOCHROME1" | "MONOCHROME2"));
    let odd = named(slices, |slice| !is_gray(slice));
    if odd.is_empty() {
        return Ok(());
    }
    let is_missing = slices.iter().any(|slice| slice.photometric.is_none());
    let what = if is_missing { "is missing" } else { "is none that the standard knows" };
    Err(SeriesError::new(
        "unknown_photometric",
        format!(
            "Photometric Interpretation (0028,0004) {what}; that of a CT is MONOCHROME1 or MONOCHROME2; send the \
             original image"
        ),
        odd,
    ))
}

/// Not more voxels than allowed, before any is decoded.
pub(super) fn size(slices: &[Slice], limits: &ReadLimits) -> Result<(), SeriesError> {
    let (rows, columns) = slices.first().and_then(|slice| slice.matrix).unwrap_or((0, 0));
    let voxels = slices.len() as u64 * u64::from(rows) * u64::from(columns);
    if voxels == 0 {
        return Err(SeriesError::new(
            "malformed",
            "Rows or Columns is missing or 0",
            named(slices, |_| true),
        ));
    }
    if voxels > limits.max_voxels {
        return Err(SeriesError::new(
            "too_large",
            format!(
                "the volume has {voxels} voxels, more than the limit of {} (jobs.max_voxels)",
                limits.max_voxels
            ),
            Vec::new(),
        ));
    }
    Ok(())
}

/// Warns of what is unusual in the slices themselves.
pub(super) fn warn(slices: &[Slice], warnings: &mut Vec<Warning>) {
    let Some(first) = slices.first() else { return };
    let geometry = first.geometry();
    if spacings_differ(geometry.row_spacing, geometry.column_spacing) {
        warnings.push(Warning::new(
            WarningCode::AnisotropicPixels,
            format!("rows are {} mm apart, columns {} mm", geometry.row_spacing, geometry.column_spacing),
        ));
    }
    if let Some((rows, columns)) = first.matrix
        && (rows != columns || rows % 2 == 1)
    {
        warnings.push(Warning::new(
            WarningCode::UnusualMatrix,
            format!("the matrix has {rows} rows and {columns} columns"),
        ));
    }
    let lossy = named(slices, |slice| slice.is_lossy).len();
    if lossy > 0 {
        warnings.push(Warning::new(
            WarningCode::LossyCompression,
            format!("{lossy} instances went through a lossy compression"),
        ));
    }
}

/// Warns of what is not written as it should in the instances of the slices.
pub(super) fn warn_of_writing(slices: &[Slice], instances: &[Instance], warnings: &mut Vec<Warning>) {
    let count = |which: fn(&Instance) -> bool| {
        let mut sources: Vec<usize> = slices.iter().map(|slice| slice.source).collect();
        sources.sort_unstable();
        sources.dedup();
        sources.into_iter().filter_map(|source| instances.get(source)).filter(|one| which(one)).count()
    };
    for (count, code, what) in [
        (
            count(|one| one.is_odd),
            WarningCode::OddEncoding,
            "have elements or sequences that are not encoded as they should; none of them is read, they were passed \
             over",
        ),
        (
            count(|one| one.frames_are_zero),
            WarningCode::ZeroFrames,
            "have a NumberOfFrames (0028,0008) of 0; it was read as 1",
        ),
    ] {
        if count > 0 {
            warnings.push(Warning::new(code, format!("{count} instances {what}")));
        }
    }
}

/// The rescale of a slice that [`rescale`] let pass.
pub(super) fn rescale_of(slice: &Slice) -> Rescale {
    slice.frame.rescale.unwrap_or(Rescale { slope: 1.0, intercept: 0.0 })
}

fn directions_differ(a: Vec3, b: Vec3) -> bool {
    a.iter().zip(b).any(|(a, b)| (a - b).abs() > DIRECTION_TOLERANCE)
}

fn spacings_differ(a: f64, b: f64) -> bool {
    (a - b).abs() > SPACING_TOLERANCE * a.max(b)
}

/// The instances of those slices, sorted, each once.
pub(super) fn named(slices: &[Slice], which: impl Fn(&Slice) -> bool) -> Vec<SopInstanceUid> {
    let mut uids: Vec<_> =
        slices.iter().filter(|slice| which(slice)).map(|slice| slice.sop_instance_uid.clone()).collect();
    uids.sort();
    uids.dedup();
    uids
}

/// Of the slices that are like the first and those that differ, the instances of the fewer ones:
/// they are the odd ones out.
fn minority(slices: &[Slice], differs: &dyn Fn(&Slice) -> bool) -> Vec<SopInstanceUid> {
    let odd = slices.iter().filter(|slice| differs(slice)).count();
    match odd {
        0 => Vec::new(),
        odd if odd * 2 <= slices.len() => named(slices, differs),
        _ => named(slices, |slice| !differs(slice)),
    }
}
