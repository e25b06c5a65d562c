//! Series → [`Volume`]: sorting, geometry, Hounsfield units.

mod check;
mod duplicates;
mod error;
mod frame;
mod identity;
mod ignored;
mod line;
mod orient;
mod slice;
mod stack;
mod unfit;
mod voxels;
mod warning;

use rayon::prelude::*;

use super::dataset::DataSet;
use super::scan::{Limits, ScanError};
use super::source::InstanceSource;
use super::uid::SopInstanceUid;
use super::{SeriesIdentity, Volume};
use crate::geometry::Axis;
use crate::pipeline::{Observer, Stage};

use frame::Instance;
use orient::Orientation;
use slice::Slice;

pub use error::SeriesError;
pub use unfit::{unfit, unfit_detail};
pub use warning::{IgnoredInstance, Warning, WarningCode};

/// What a series may be at most, and must be at least.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReadLimits {
    /// Voxels of the volume (setting `jobs.max_voxels`).
    pub max_voxels: u64,
    /// Slices that a volume needs; never fewer than 2.
    pub min_slices: usize,
    /// Of each instance.
    pub scan: Limits,
}

impl Default for ReadLimits {
    fn default() -> Self {
        Self { max_voxels: 1 << 30, min_slices: 10, scan: Limits::default() }
    }
}

/// Reads the instances of one series into a volume.
///
/// Goes over the instances twice: for their attributes, to sort and to check them, and for their
/// pixels. Slices are sorted by the projection of ImagePositionPatient on their normal; file
/// names and Instance Number don't count. Runs on the rayon pool it is called from.
///
/// # Errors
/// [`SeriesError`]: the series is no volume whose geometry can be trusted, or can't be decoded.
pub fn read(
    source: &dyn InstanceSource,
    limits: &ReadLimits,
    observer: &dyn Observer,
) -> Result<(Volume, Vec<Warning>), SeriesError> {
    observer.progress(Stage::Reading, 0.0);
    let mut warnings = Vec::new();
    let instances = attributes(source, limits, observer)?;
    identity::one_study(&instances)?;
    identity::one_patient(&instances)?;
    let (mut slices, ignored) = slice::candidates(&instances)?;
    ignored::warn(&ignored, &mut warnings);
    check::geometry(&slices)?;
    check::consistency(&slices)?;
    check::size(&slices, limits)?;
    let Some(normal) = slices.first().map(|slice| slice.geometry().normal()) else {
        return Err(too_few(&slices, limits));
    };
    stack::sort(&mut slices, normal);
    duplicates::remove(source, &mut slices, normal, limits, &mut warnings)?;
    line::straight(&slices, normal)?;
    stack::missing(&slices, normal, &ignored)?;
    stack::unusable(&slices, normal, &ignored)?;
    stack::too_far_apart(&slices, normal)?;
    if slices.len() < limits.min_slices.max(2) {
        return Err(too_few(&slices, limits));
    }
    slice::only_ct(&instances)?;
    check::photometric(&slices)?;
    check::rescale(&slices)?;

    let geometry = slices[0].geometry();
    let orientation = Orientation::nearest(normal, geometry.down_column, geometry.along_row);
    stack::warn(&slices, normal, &mut warnings);
    orient::warn(orientation, &slices[0], &mut warnings);
    check::warn(&slices, &mut warnings);
    check::warn_of_writing(&slices, &instances, &mut warnings);
    if orientation.slices.flipped {
        slices.reverse();
    }
    if orientation.slices.axis == Axis::Z {
        stack::warn_of_descending(&slices, &mut warnings);
    }
    let (rows, columns) = slices[0].matrix.map_or((0, 0), |(r, c)| (usize::from(r), usize::from(c)));
    let hu = voxels::read(source, &slices, orientation, limits, observer, &mut warnings)?;
    let grid = orient::grid(&slices, orientation, rows, columns).ok_or_else(|| too_few(&slices, limits))?;
    let identity = identity(&instances, &slices)?;
    warnings.sort_by_key(|warning| warning.code);
    let sop_instance_uids = slices.into_iter().map(|slice| slice.sop_instance_uid).collect();
    Ok((Volume { hu, grid, sop_instance_uids, identity }, warnings))
}

/// The attributes of all instances, in the order of the source.
fn attributes(
    source: &dyn InstanceSource,
    limits: &ReadLimits,
    observer: &dyn Observer,
) -> Result<Vec<Instance>, SeriesError> {
    let read = |index| {
        if observer.cancelled() {
            return Err(cancelled());
        }
        let bytes = source.read(index).map_err(|error| unreadable(&error, Vec::new()))?;
        let data_set = DataSet::open(&bytes, &limits.scan).map_err(|error| unscannable(error, Vec::new()))?;
        Instance::of(&data_set).ok_or_else(|| {
            SeriesError::new("malformed", "an instance has no valid SOPInstanceUID (0008,0018)", Vec::new())
        })
    };
    let results: Vec<_> = (0..source.len()).into_par_iter().map(read).collect();
    results.into_iter().collect()
}

fn identity(instances: &[Instance], slices: &[Slice]) -> Result<SeriesIdentity, SeriesError> {
    let first = slices.first().and_then(|slice| instances.get(slice.source));
    let series = first.and_then(|instance| instance.series_instance_uid.clone());
    Ok(SeriesIdentity {
        study_instance_uid: first.and_then(|instance| instance.study_instance_uid.clone()),
        series_instance_uid: series.ok_or_else(|| {
            let instances = check::named(slices, |slice| slice.series_instance_uid.is_none());
            SeriesError::new("malformed", "SeriesInstanceUID (0020,000E) is missing or not valid", instances)
        })?,
        frame_of_reference_uid: first.and_then(|instance| instance.frame_of_reference_uid.clone()),
    })
}

fn too_few(slices: &[Slice], limits: &ReadLimits) -> SeriesError {
    SeriesError::new(
        "too_few_slices",
        format!("{} slices make no volume; at least {} are needed", slices.len(), limits.min_slices.max(2)),
        check::named(slices, |_| true),
    )
}

fn cancelled() -> SeriesError {
    SeriesError::new("cancelled", "cancelled while the series was read", Vec::new())
}

fn unreadable(error: &std::io::Error, instances: Vec<SopInstanceUid>) -> SeriesError {
    SeriesError::new("unreadable", format!("an instance can't be read from storage: {error}"), instances)
}

fn unscannable(error: ScanError, instances: Vec<SopInstanceUid>) -> SeriesError {
    let code = match &error {
        ScanError::UnsupportedTransferSyntax(_) => "unsupported_transfer_syntax",
        ScanError::InflatesTooMuch { .. } => "too_large",
        ScanError::Io(_) => "unreadable",
        _ => "malformed",
    };
    SeriesError::new(code, error.to_string(), instances)
}
