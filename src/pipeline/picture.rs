//! A slice with its contour, for eyes.

use image::{Rgb, RgbImage};
use ndarray::ArrayView2;

use super::contour::outline;
use super::mask::mask;
use super::parameters::Parameters;
use super::precise::{BorderPoint, StretchReason};
use super::slices;
use super::whole_skin::slice_of;
use crate::dicom::Volume;
use crate::geometry::{Axis, Plane, norm};

/// Colour of an accepted contour.
const ACCEPTED: Rgb<u8> = Rgb([0, 255, 0]);
/// Colour of a rejected contour of `paper`.
const REJECTED: Rgb<u8> = Rgb([255, 0, 0]);
/// Colours of rejected stretches with their names, in the order of the reasons; after the last the
/// first comes again.
const STRETCHES: [(&str, Rgb<u8>); StretchReason::ALL.len()] = [
    ("red", REJECTED),
    ("orange", Rgb([255, 150, 0])),
    ("violet", Rgb([160, 90, 255])),
    ("blue", Rgb([70, 130, 255])),
    ("magenta", Rgb([255, 0, 255])),
    ("yellow", Rgb([255, 255, 0])),
];
/// HU shown black and white: the soft tissue that the paper's mask looks for, and some more.
const WINDOW: (f32, f32) = (-400.0, 400.0);
/// No side of a picture is longer, px.
const LONGEST: f64 = 4096.0;

/// The slice as radiologists look at it, its contour under the profile `paper` (if there is one)
/// green for an accepted slice and red for a rejected one. `None` if there is no such slice.
///
/// Upright: anterior at the top of axial slices, the head's top at the top of the others (row 0 of
/// the slice is at the bottom). The patient's right is at the left of axial and coronal slices, the
/// back at the left of sagittal ones. A pixel is as wide as it is high in mm: the smaller side of a
/// voxel.
#[must_use]
pub fn picture(
    volume: &Volume,
    parameters: &Parameters,
    plane: Plane,
    index: usize,
    accepted: bool,
) -> Option<RgbImage> {
    let slice = slices::view(&volume.hu, plane, index)?;
    let mut canvas = Canvas::new(volume, plane, slice);
    if let Some(outline) = outline(mask(slice, parameters), plane, &parameters.thresholds.contour) {
        let colour = if accepted { ACCEPTED } else { REJECTED };
        for pixel in &outline.contour.pixels {
            canvas.fill(f64::from(pixel.row), f64::from(pixel.column), (1.0, 1.0), colour);
        }
    }
    Some(canvas.image)
}

/// The same under the profile `precise`: the patient's border of that slice, accepted stretches
/// green, rejected ones in the colour of their reason ([`legend`]).
#[must_use]
pub fn border_picture(
    volume: &Volume,
    border: &[BorderPoint],
    plane: Plane,
    index: usize,
) -> Option<RgbImage> {
    let slice = slices::view(&volume.hu, plane, index)?;
    let mut canvas = Canvas::new(volume, plane, slice);
    let of_slice = |point: &&BorderPoint| slice_of(point, plane) == Some(index);
    let (rejected, accepted): (Vec<_>, Vec<_>) =
        border.iter().filter(of_slice).partition(|point| point.reason.is_some());
    // What was rejected lies over what was not.
    for point in accepted.into_iter().chain(rejected) {
        let (row, column, along_rows) = canvas.place(plane, volume.grid.shape(), point);
        // As wide as the line of voxels that it was measured in, so that the contour has no gaps.
        let size = if along_rows { (0.0, 1.0) } else { (1.0, 0.0) };
        canvas.fill(row, column, size, point.reason.map_or(ACCEPTED, colour));
    }
    Some(canvas.image)
}

/// What the colours of [`border_picture`] mean: each reason's name with that of its colour.
#[must_use]
pub fn legend() -> Vec<(&'static str, &'static str)> {
    StretchReason::ALL.map(|reason| (reason.name(), STRETCHES[reason as usize].0)).into()
}

fn colour(reason: StretchReason) -> Rgb<u8> {
    STRETCHES[reason as usize].1
}

/// A picture that grows, in the rows and columns of its slice.
struct Canvas {
    image: RgbImage,
    /// Pixels of the picture for one row and for one column of the slice.
    scale: (f64, f64),
}

impl Canvas {
    /// The slice in grey.
    fn new(volume: &Volume, plane: Plane, slice: ArrayView2<'_, i16>) -> Self {
        let (rows, columns) = slice.dim();
        let (row_axis, column_axis) = axes(plane);
        let mm = |axis: Axis| norm(volume.grid.step()[axis as usize]);
        let finest = mm(row_axis).min(mm(column_axis));
        let scale = (mm(row_axis) / finest, mm(column_axis) / finest);
        #[expect(clippy::cast_precision_loss, reason = "rows and columns of a picture")]
        let (height, width) = (rows as f64 * scale.0, columns as f64 * scale.1);
        let shrink = f64::min(1.0, LONGEST / height.max(width));
        let scale = (scale.0 * shrink, scale.1 * shrink);
        let side = |length: f64| pixel((length * shrink).round()).max(1);
        let (height, width) = (side(height), side(width));
        let image = RgbImage::from_fn(width, height, |x, y| {
            let at = |pixel: u32, scale: f64, count: usize| {
                (((f64::from(pixel) + 0.5) / scale) as usize).min(count - 1)
            };
            Rgb([grey(slice[[at(height - 1 - y, scale.0, rows), at(x, scale.1, columns)]]); 3])
        });
        Self { image, scale }
    }

    /// Row and column of a point of the border, and whether it moves along the rows' axis.
    fn place(&self, plane: Plane, shape: [usize; 3], point: &BorderPoint) -> (f64, f64, bool) {
        let (row_axis, column_axis) = axes(plane);
        let row = f64::from(point.index[row_axis as usize]);
        #[expect(clippy::cast_precision_loss, reason = "numbers of slices")]
        let row = if row_axis == Axis::Z { (shape[0] - 1) as f64 - row } else { row };
        let column = f64::from(point.index[column_axis as usize]);
        (row, column, usize::from(point.axis) == row_axis as usize)
    }

    /// Colours what lies within `size` rows and columns around a place, at least one pixel.
    fn fill(&mut self, row: f64, column: f64, size: (f64, f64), colour: Rgb<u8>) {
        // Pixel and voxel n reach from n to n + 1 here: their centres lie between.
        let span = |place: f64, size: f64, scale: f64, end: u32| {
            let centre = (place + 0.5) * scale;
            let first = pixel((centre - size * scale / 2.0 + 0.5).floor()).min(end - 1);
            let last = pixel((centre + size * scale / 2.0 + 0.5).floor()).min(end);
            let only = pixel(centre.floor()).min(end - 1);
            if first < last { first..last } else { only..only + 1 }
        };
        let (width, height) = self.image.dimensions();
        for y in span(row, size.0, self.scale.0, height) {
            for x in span(column, size.1, self.scale.1, width) {
                self.image.put_pixel(x, height - 1 - y, colour);
            }
        }
    }
}

/// The array axes of a slice's rows and columns.
fn axes(plane: Plane) -> (Axis, Axis) {
    match plane {
        Plane::Axial => (Axis::Y, Axis::X),
        Plane::Sagittal => (Axis::Z, Axis::Y),
        Plane::Coronal => (Axis::Z, Axis::X),
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "casts from floats saturate")]
fn pixel(place: f64) -> u32 {
    place as u32
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to a byte")]
fn grey(hu: i16) -> u8 {
    let (black, white) = WINDOW;
    ((f32::from(hu) - black) / (white - black) * 255.0).clamp(0.0, 255.0) as u8
}
