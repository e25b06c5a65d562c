//! Series → [`Volume`]: sorting, geometry, Hounsfield units.

mod check;
mod coherence;
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
use crate::memory::{Memory, NoMemory};
use crate::observer::{Observer, Stage};

use frame::Instance;
use orient::Orientation;
use slice::Slice;

pub use error::SeriesError;
pub(crate) use unfit::no_slice;
pub use unfit::{UnfitReason, unfit, unfit_detail};
pub use warning::{DoubtfulRows, IgnoredInstance, RowsDoubt, Warning, WarningCode};

/// The code of a series that finds no memory because others use it.
pub const OUT_OF_MEMORY: &str = "out_of_memory_budget";

/// What a series may be at most, and must be at least.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReadLimits {
    /// Voxels of the volume (setting `jobs.max_voxels`).
    pub max_voxels: u64,
    /// Slices that a volume needs; never fewer than 2.
    pub min_slices: usize,
    /// Of each instance.
    pub scan: Limits,
    /// What decoding and the volume may take.
    pub memory: Memory,
}

impl Default for ReadLimits {
    fn default() -> Self {
        Self { max_voxels: 1 << 30, min_slices: 10, scan: Limits::default(), memory: Memory::unlimited() }
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
    read_admitted(source, limits, observer, &mut |_| Ok(0))
}

/// The same, with the volume admitted by its number of voxels before memory is taken for it; `admit` tells
/// how many bytes of the budget the caller then holds.
///
/// # Errors
/// As for [`read`]; `too_large_for_memory` and `out_of_memory_budget` where `admit` or decoding finds
/// no memory.
pub fn read_admitted(
    source: &dyn InstanceSource,
    limits: &ReadLimits,
    observer: &dyn Observer,
    admit: &mut dyn FnMut(u64) -> Result<u64, NoMemory>,
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
    duplicates::remove(source, &mut slices, normal, limits, observer, &mut warnings)?;
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
    let held = admit(slices.len() as u64 * rows as u64 * columns as u64);
    let held = held.map_err(|none| no_memory(none, Vec::new()))?;
    let decoding = Decoding { limits, held, observer };
    let (hu, findings) = voxels::read(source, &slices, orientation, &decoding, &mut warnings)?;
    let doubtful_slices = coherence::tell(&findings, &slices, &mut warnings)?;
    let grid = orient::grid(&slices, orientation, rows, columns).ok_or_else(|| too_few(&slices, limits))?;
    let identity = identity(&instances, &slices)?;
    warnings.sort_by_key(|warning| warning.code);
    let sop_instance_uids = slices.into_iter().map(|slice| slice.sop_instance_uid).collect();
    Ok((Volume { hu, grid, sop_instance_uids, doubtful_slices, identity }, warnings))
}

/// What decoding keeps to.
struct Decoding<'a> {
    limits: &'a ReadLimits,
    /// Bytes of the budget that are held as long as it lasts.
    held: u64,
    observer: &'a dyn Observer,
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
        let mut memory = limits.memory.take(source.size(index).unwrap_or_default());
        let memory = memory.as_mut().map_err(|none| no_memory(*none, Vec::new()))?;
        let bytes = source.read_unless(index, &|| observer.cancelled());
        let bytes = bytes.map_err(|error| unreadable(&error, Vec::new()))?;
        let data_set = DataSet::open_within(&bytes, &limits.scan, memory, &|| observer.cancelled());
        let data_set = data_set.map_err(|error| unscannable(error, 0, Vec::new()))?;
        Instance::of(&data_set).ok_or_else(|| {
            SeriesError::new("malformed", "an instance has no valid SOPInstanceUID (0008,0018)", Vec::new())
        })
    };
    let results: Vec<_> = (0..source.len()).into_par_iter().map(read).collect();
    // One after the other, those for which there was no memory beside the others.
    let again = results.into_iter().enumerate();
    again.map(|(index, result)| result.or_else(|error| alone(error, || read(index)))).collect()
}

/// What found no memory beside others is done once more without them.
fn alone<T>(error: SeriesError, again: impl FnOnce() -> Result<T, SeriesError>) -> Result<T, SeriesError> {
    if error.code() == OUT_OF_MEMORY { again() } else { Err(error) }
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
    if error.kind() == std::io::ErrorKind::Interrupted {
        return cancelled();
    }
    SeriesError::new("unreadable", format!("an instance can't be read from storage: {error}"), instances)
}

/// No memory: never, or not now.
fn no_memory(none: NoMemory, instances: Vec<SopInstanceUid>) -> SeriesError {
    if none.never_fits() {
        let detail = format!("{none}; raise it, or reconstruct on a machine with more memory");
        return SeriesError::new("too_large_for_memory", detail, instances);
    }
    let detail = format!("{none}, and others use too much of it now; it is tried again");
    SeriesError::new(OUT_OF_MEMORY, detail, instances)
}

fn unscannable(error: ScanError, held: u64, instances: Vec<SopInstanceUid>) -> SeriesError {
    let code = match &error {
        ScanError::NoMemory(none) => return no_memory(none.beside(held), instances),
        ScanError::Stopped => return cancelled(),
        ScanError::UnsupportedTransferSyntax(_) => "unsupported_transfer_syntax",
        ScanError::InflatesTooMuch { .. } => "too_large",
        ScanError::Io(_) => "unreadable",
        _ => "malformed",
    };
    SeriesError::new(code, error.to_string(), instances)
}
