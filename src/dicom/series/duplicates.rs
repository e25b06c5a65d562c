//! Two slices at one position: the same one twice, or an error.

use super::slice::Slice;
use super::{ReadLimits, SeriesError, Warning, WarningCode, stack};
use crate::dicom::dataset::DataSet;
use crate::dicom::pixels::{BYTES_A_PIXEL, Frames};
use crate::dicom::source::InstanceSource;
use crate::geometry::{Vec3, norm, sub};
use crate::observer::Observer;

/// Positions of the same slice agree to this, mm.
const SAME_PLACE: f64 = 1e-3;

/// Of slices at one position with the same pixels and rescale, keeps the first. The stack is
/// sorted along `normal`.
pub(super) fn remove(
    source: &dyn InstanceSource,
    slices: &mut Vec<Slice>,
    normal: Vec3,
    limits: &ReadLimits,
    observer: &dyn Observer,
    warnings: &mut Vec<Warning>,
) -> Result<(), SeriesError> {
    let groups = stack::at_one_position(slices, normal);
    let dropped = slices.len() - groups.len();
    if dropped == 0 {
        return Ok(());
    }
    for group in groups.iter().filter(|group| group.len() > 1) {
        let slices = &slices[group.clone()];
        let mut first = None;
        for slice in slices {
            let values = content(source, slice, limits, observer)?;
            let is_same = first.as_ref().is_none_or(|(place, rescale, pixels)| {
                norm(sub(*place, slice.geometry().position)) < SAME_PLACE
                    && *rescale == slice.frame.rescale
                    && *pixels == values
            });
            if !is_same {
                return Err(SeriesError::new(
                    "duplicate_position",
                    "different slices lie at one position: this is no volume, or more than one; send one volume \
                     as one series",
                    super::check::named(slices, |_| true),
                ));
            }
            first.get_or_insert((slice.geometry().position, slice.frame.rescale, values));
        }
    }
    let mut starts = groups.iter().map(|group| group.start).peekable();
    let mut index = 0;
    slices.retain(|_| {
        let keep = starts.next_if_eq(&index).is_some();
        index += 1;
        keep
    });
    warnings.push(Warning::new(
        WarningCode::DuplicateInstances,
        format!("{dropped} slices were there twice with the same content and were left out"),
    ));
    Ok(())
}

fn content(
    source: &dyn InstanceSource,
    slice: &Slice,
    limits: &ReadLimits,
    observer: &dyn Observer,
) -> Result<Vec<i32>, SeriesError> {
    let name = || vec![slice.sop_instance_uid.clone()];
    let stopped = || observer.cancelled();
    if stopped() {
        return Err(super::cancelled());
    }
    let pixels = slice.matrix.map_or(0, |(rows, columns)| u64::from(rows) * u64::from(columns));
    let need = source.size(slice.source).unwrap_or_default() + pixels * BYTES_A_PIXEL;
    let mut memory = limits.memory.take(need).map_err(|none| super::no_memory(none, name()))?;
    let bytes = source.read_unless(slice.source, &stopped);
    let bytes = bytes.map_err(|error| super::unreadable(&error, name()))?;
    let data_set = DataSet::open_within(&bytes, &limits.scan, &mut memory, &stopped);
    let data_set = data_set.map_err(|error| super::unscannable(error, 0, name()))?;
    let frames = Frames::of(&data_set).map_err(|error| super::voxels::undecodable(&error, name()))?;
    let stored = frames.stored(slice.frame_index);
    stored.map(|stored| stored.values).map_err(|error| super::voxels::undecodable(&error, name()))
}
