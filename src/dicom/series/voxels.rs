//! Decodes the slices into Hounsfield units, in parallel, each to its place in the array.

use std::fmt::Write as _;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use dicom_dictionary_std::tags;
use ndarray::Array3;
use rayon::prelude::*;

use super::check::rescale_of;
use super::coherence::{self, Finding, Reading, Stack};
use super::frame::{Geometry, Rescale};
use super::orient::Orientation;
use super::slice::Slice;
use super::{Decoding, SeriesError, Warning, WarningCode};
use crate::dicom::dataset::DataSet;
use crate::dicom::pixels::{BYTES_A_PIXEL, Frames, PixelError};
use crate::dicom::source::InstanceSource;
use crate::geometry::Axis;
use crate::observer::stop::{Asked, unless_stopped};
use crate::observer::{Observer, Stage};

/// Hounsfield units that pixels marked as padding (PS3.3 section C.7.5.1.1.2) get: air.
pub(super) const PADDING_HU: i16 = -1024;
/// Padding above this could be tissue: half the way from air to water, HU.
const TISSUE_HU: f64 = -500.0;

/// A slice and the part of the array that is its own.
struct Place<'a> {
    /// Index of the slice.
    z: usize,
    slice: &'a Slice,
    hu: &'a mut [i16],
    /// By how many bytes a block of its compressed frame ended off its end.
    off_its_end: u32,
}

/// What is counted on the way.
#[derive(Default)]
struct Counts {
    clipped: AtomicU64,
    padding: AtomicU64,
    /// Of those, the ones whose value stands for tissue.
    tissue: AtomicU64,
    /// Pixels with bits beside their value.
    masked: AtomicU64,
    /// Instances with zeros after their pixels.
    trailing: AtomicU64,
    done: AtomicUsize,
}

/// The voxels `[[z, y, x]]` of slices that are sorted along the volume's axis, and which of the slices
/// don't go with their neighbours.
pub(super) fn read(
    source: &dyn InstanceSource,
    slices: &[Slice],
    orientation: Orientation,
    decoding: &Decoding<'_>,
    warnings: &mut Vec<Warning>,
) -> Result<(Array3<i16>, Vec<Finding>), SeriesError> {
    let (rows, columns) = slices.first().and_then(|slice| slice.matrix).unwrap_or((0, 0));
    let (rows, columns) = (usize::from(rows), usize::from(columns));
    let layout = Layout::new(orientation, rows, columns);
    let mut voxels = vec![0_i16; slices.len() * rows * columns];
    let counts = Counts::default();

    // The frames of one instance share one reading of its bytes.
    let parts = voxels.chunks_exact_mut((rows * columns).max(1));
    let place = |(z, (slice, hu))| Place { z, slice, hu, off_its_end: 0 };
    let mut places: Vec<Place<'_>> = slices.iter().zip(parts).enumerate().map(place).collect();
    places.sort_by_key(|place| place.slice.source);
    let mut by_instance: Vec<_> = places.chunk_by_mut(|a, b| a.slice.source == b.slice.source).collect();
    let decode =
        |places: &mut &mut [Place<'_>]| instance(source, places, &layout, decoding, &counts, slices.len());
    let results: Vec<Result<(), SeriesError>> = by_instance.par_iter_mut().map(decode).collect();
    // The first in the order of the source, not in the order in which threads came to it; and one after
    // the other, those for which there was no memory beside the others.
    for (places, result) in by_instance.iter_mut().zip(results) {
        result.or_else(|error| super::alone(error, || decode(places)))?;
    }

    let off_their_ends: Vec<(usize, u32)> = places.iter().map(|place| (place.z, place.off_its_end)).collect();
    let observer = decoding.observer;
    let tissue = counts.tissue.into_inner();
    let mut padding = "pixels are marked as padding and were set to air".to_owned();
    if tissue > 0 {
        let _infallible = write!(
            padding,
            "; {tissue} of them have a value of tissue (above {TISSUE_HU} HU): tissue of the same value was set to air \
             too, and the surface there can't be trusted; have PixelPaddingValue (0028,0120) and \
             PixelPaddingRangeLimit (0028,0121) corrected"
        );
    }
    for (count, code, what) in [
        (counts.padding, WarningCode::Padding, padding.as_str()),
        (counts.clipped, WarningCode::ClippedHu, "values are beyond -32768 to 32767 HU and were clipped"),
        (counts.masked, WarningCode::UnusedBits, "pixels had bits set beside their value, which were masked"),
        (counts.trailing, WarningCode::TrailingZeros, "instances have zeros after their pixels"),
    ] {
        let count = count.into_inner();
        if count > 0 {
            warnings.push(Warning::new(code, format!("{count} {what}")));
        }
    }
    let reading = |slice: &Slice| Reading { rescale: rescale_of(slice), format: slice.format };
    let readings: Vec<Reading> = slices.iter().map(reading).collect();
    let stack = layout.stack(&voxels, slices, &readings);
    let findings = unless_stopped(|| coherence::findings(&stack, &off_their_ends, observer));
    let findings = findings.map_err(|_stopped| super::cancelled())?;
    // What is found in a part of the slices counts for nothing.
    if observer.cancelled() {
        return Err(super::cancelled());
    }
    let hu = layout.volume(voxels, slices.len(), observer).ok_or_else(super::cancelled)?;
    Ok((hu, findings))
}

/// Decodes the frames of one instance.
fn instance(
    source: &dyn InstanceSource,
    places: &mut [Place<'_>],
    layout: &Layout,
    &Decoding { limits, held, observer }: &Decoding<'_>,
    counts: &Counts,
    total: usize,
) -> Result<(), SeriesError> {
    let Some(Place { slice: first, .. }) = places.first() else { return Ok(()) };
    let first: &Slice = first;
    let name = || vec![first.sop_instance_uid.clone()];
    let source_index = first.source;
    // The file, and on each thread that decodes a frame of it what the codec gives and the values.
    let pixels = places.iter().map(|place| place.hu.len() as u64).max().unwrap_or_default();
    let frames_at_a_time = places.len().min(rayon::current_num_threads()) as u64;
    let need = source.size(source_index).unwrap_or_default() + pixels * frames_at_a_time * BYTES_A_PIXEL;
    let memory = limits.memory.take(need);
    let mut memory = memory.map_err(|none| super::no_memory(none.beside(held), name()))?;
    let bytes = source
        .read_unless(source_index, &|| observer.cancelled())
        .map_err(|error| super::unreadable(&error, name()))?;
    let data_set = DataSet::open_within(&bytes, &limits.scan, &mut memory, &|| observer.cancelled());
    let data_set = data_set.map_err(|error| super::unscannable(error, held, name()))?;
    let frames = Frames::of(&data_set).map_err(|error| undecodable(&error, name()))?;
    counts.trailing.fetch_add(u64::from(frames.surplus > 0), Ordering::Relaxed);
    let padding = Padding::of(&data_set, frames.format.signed);
    let results: Vec<Result<(), SeriesError>> = places
        .par_iter_mut()
        .map(|Place { slice, hu, off_its_end, .. }| {
            if observer.cancelled() {
                return Err(super::cancelled());
            }
            let stored = frames.stored(slice.frame_index).map_err(|error| undecodable(&error, name()))?;
            counts.masked.fetch_add(stored.masked, Ordering::Relaxed);
            if stored.values.len() != hu.len() {
                let error = PixelError::Decode("the instance changed while it was read".into());
                return Err(undecodable(&error, name()));
            }
            *off_its_end = stored.off_its_end;
            let to_hu = ToHu { rescale: rescale_of(slice), padding };
            layout.fill(hu, &stored.values, &to_hu, counts, observer)?;
            let done = counts.done.fetch_add(1, Ordering::Relaxed) + 1;
            #[expect(clippy::cast_precision_loss)]
            observer.progress(Stage::Reading, done as f64 / total as f64);
            Ok(())
        })
        .collect();
    results.into_iter().collect()
}

pub(super) fn undecodable(
    error: &PixelError,
    instances: Vec<crate::dicom::uid::SopInstanceUid>,
) -> SeriesError {
    let code = match error {
        PixelError::NoPixelData => "no_pixel_data",
        PixelError::Photometric(_) => "unknown_photometric",
        PixelError::Description(_) => "malformed",
        PixelError::Extent(_) => "pixel_data_size",
        PixelError::Decode(_) => "decode_failed",
    };
    SeriesError::new(code, format!("{error}; send the original image again"), instances)
}

/// The stored values that are padding, from first to last.
#[derive(Clone, Copy)]
struct Padding(Option<(i32, i32)>);

impl Padding {
    fn of(data_set: &DataSet<'_>, signed: bool) -> Self {
        let value = |tag| {
            data_set
                .top()
                .u16(tag)
                .map(|raw| if signed { i32::from(raw.cast_signed()) } else { i32::from(raw) })
        };
        Self(value(tags::PIXEL_PADDING_VALUE).map(|value_of| {
            let limit = value(tags::PIXEL_PADDING_RANGE_LIMIT).unwrap_or(value_of);
            (value_of.min(limit), value_of.max(limit))
        }))
    }

    fn contains(self, stored: i32) -> bool {
        self.0.is_some_and(|(first, last)| (first..=last).contains(&stored))
    }
}

/// From a stored value to Hounsfield units.
struct ToHu {
    rescale: Rescale,
    padding: Padding,
}

/// Where the pixels of a slice go within its part of the array: always the slower of the two
/// remaining volume axes first.
struct Layout {
    orientation: Orientation,
    rows: usize,
    columns: usize,
    /// Columns of the scan run along the faster axis.
    rows_are_slower: bool,
}

impl Layout {
    fn new(orientation: Orientation, rows: usize, columns: usize) -> Self {
        let rows_are_slower = (orientation.rows.axis as usize) < orientation.columns.axis as usize;
        Self { orientation, rows, columns, rows_are_slower }
    }

    fn fill(
        &self,
        place: &mut [i16],
        stored: &[i32],
        to_hu: &ToHu,
        counts: &Counts,
        observer: &dyn Observer,
    ) -> Result<(), SeriesError> {
        let (mut clipped, mut padding, mut tissue) = (0_u64, 0_u64, 0_u64);
        for (r, row) in stored.chunks_exact(self.columns.max(1)).enumerate() {
            if observer.cancelled() {
                return Err(super::cancelled());
            }
            let r = if self.orientation.rows.flipped { self.rows - 1 - r } else { r };
            for (c, &value) in row.iter().enumerate() {
                let c = if self.orientation.columns.flipped { self.columns - 1 - c } else { c };
                // Truncated toward zero and clipped by the conversion.
                let hu = (to_hu.rescale.slope * f64::from(value) + to_hu.rescale.intercept).trunc();
                let hu = if to_hu.padding.contains(value) {
                    padding += 1;
                    tissue += u64::from(hu > TISSUE_HU);
                    PADDING_HU
                } else {
                    clipped += u64::from(hu < f64::from(i16::MIN) || hu > f64::from(i16::MAX));
                    #[expect(clippy::cast_possible_truncation)]
                    {
                        hu as i16
                    }
                };
                let at = if self.rows_are_slower { r * self.columns + c } else { c * self.rows + r };
                place[at] = hu;
            }
        }
        counts.clipped.fetch_add(clipped, Ordering::Relaxed);
        counts.padding.fetch_add(padding, Ordering::Relaxed);
        counts.tissue.fetch_add(tissue, Ordering::Relaxed);
        Ok(())
    }

    /// The slices as they were acquired, one after another in `voxels`.
    fn stack<'a>(&self, voxels: &'a [i16], slices: &[Slice], readings: &'a [Reading]) -> Stack<'a> {
        let normal = slices.first().map_or([0.0; 3], |slice| slice.geometry().normal());
        let places: Vec<f64> = slices.iter().map(|slice| slice.along(normal)).collect();
        let step_mm = places.windows(2).map(|two| (two[1] - two[0]).abs()).fold(0.0, f64::max);
        let px = |spacing: fn(Geometry) -> f64| {
            slices.first().map_or(1.0, |slice| step_mm / spacing(slice.geometry()))
        };
        Stack {
            voxels,
            readings,
            count: slices.len(),
            rows: self.rows,
            columns: self.columns,
            by_rows: self.rows_are_slower,
            rows_flipped: self.orientation.rows.flipped,
            step_mm,
            step_px: [px(|geometry| geometry.row_spacing), px(|geometry| geometry.column_spacing)],
        }
    }

    /// The whole array in the order of the volume, `count` slices one after another in `voxels`; `None` if
    /// the observer asked to stop.
    fn volume(&self, voxels: Vec<i16>, count: usize, observer: &dyn Observer) -> Option<Array3<i16>> {
        let (slower, faster) =
            if self.rows_are_slower { (self.rows, self.columns) } else { (self.columns, self.rows) };
        let by_slice =
            Array3::from_shape_vec((count, slower, faster), voxels).expect("as many voxels as slices have");
        let other = match self.orientation.slices.axis {
            Axis::Z => return Some(by_slice),
            // [y][z][x] and [x][z][y].
            Axis::Y => by_slice.permuted_axes([1, 0, 2]),
            Axis::X => by_slice.permuted_axes([1, 2, 0]),
        };
        let mut hu = Array3::zeros(other.dim());
        for (mut to, from) in hu.outer_iter_mut().zip(other.outer_iter()) {
            if observer.cancelled() {
                return None;
            }
            to.assign(&from);
        }
        let turned = other.into_raw_vec_and_offset().0;
        unless_stopped(|| Asked::of(observer).free(turned)).ok()?;
        Some(hu)
    }
}
