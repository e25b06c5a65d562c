//! A slice with its contour, for eyes.

use image::{Rgb, RgbImage};
use ndarray::{Array2, ArrayView2};

use crate::dicom::Volume;
use crate::geometry::{Axis, Plane, norm};
use crate::observer::stop::Asked;
use crate::pipeline::paper::contour::outline;
use crate::pipeline::paper::mask::mask;
use crate::pipeline::parameters::Parameters;
use crate::pipeline::precise::reconstruction::slice_of;
use crate::pipeline::precise::{BorderPoint, StretchReason};
use crate::pipeline::result::{Contours, Reconstruction};
use crate::pipeline::slices;

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
pub(crate) const WINDOW: (f32, f32) = (-400.0, 400.0);
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
    let mut canvas = Canvas::of_volume(volume, plane, slice);
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
    let mut canvas = Canvas::of_volume(volume, plane, slice);
    let of_slice = |point: &&BorderPoint| slice_of(point, plane) == Some(index);
    let (rejected, accepted): (Vec<&BorderPoint>, Vec<&BorderPoint>) =
        border.iter().filter(of_slice).partition(|point| point.reason.is_some());
    // What was rejected lies over what was not.
    for point in accepted.into_iter().chain(rejected) {
        let (row_axis, column_axis) = axes(plane);
        let (row, column) = (point.index[row_axis as usize], point.index[column_axis as usize]);
        let along_rows = usize::from(point.axis) == row_axis as usize;
        canvas.cross(
            plane,
            volume.grid.shape()[0],
            (row, column),
            along_rows,
            point.reason.map_or(ACCEPTED, colour),
        );
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

/// What is drawn over a slice at one place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Mark {
    /// Row of the slice (`paper`), or voxel index along the axis of its rows (`precise`).
    pub(crate) row: f32,
    /// The same of the columns.
    pub(crate) column: f32,
    /// `precise`: whether the grid line follows the rows' axis.
    pub(crate) along_rows: bool,
    /// Its colour among [`COLOURS`].
    pub(crate) kind: u8,
}

/// Colours of marks: accepted, rejected (`paper`), then those of the stretches' reasons.
pub(crate) const COLOURS: [Rgb<u8>; 2 + StretchReason::ALL.len()] = {
    let mut colours = [ACCEPTED; 2 + StretchReason::ALL.len()];
    colours[1] = REJECTED;
    let mut reason = 0;
    while reason < StretchReason::ALL.len() {
        colours[2 + reason] = STRETCHES[reason].1;
        reason += 1;
    }
    colours
};

/// The marks of each slice of a plane, in the order in which they are drawn.
pub(crate) fn marks_of_plane(
    asked: Asked<'_>,
    result: &Reconstruction,
    shape: [usize; 3],
    plane: Plane,
) -> Vec<Vec<Mark>> {
    let mut marks = vec![Vec::new(); slices::count(shape, plane)];
    match &result.contours {
        Contours::Pixels(contours) => {
            for (row, contour) in result.slices.iter().zip(contours).filter(|(row, _)| row.plane == plane) {
                asked.ask();
                let Some(marks) = marks.get_mut(row.index) else { continue };
                let kind = u8::from(row.rejection.is_some());
                #[expect(clippy::cast_precision_loss, reason = "rows and columns of a slice")]
                marks.extend(contour.iter().map(|pixel| Mark {
                    row: pixel.row as f32,
                    column: pixel.column as f32,
                    along_rows: false,
                    kind,
                }));
            }
        }
        Contours::Border(border) => {
            let (row_axis, column_axis) = axes(plane);
            for (number, point) in border.iter().enumerate() {
                asked.ask_at(number);
                let Some(marks) = slice_of(point, plane).and_then(|index| marks.get_mut(index)) else {
                    continue;
                };
                marks.push(Mark {
                    row: point.index[row_axis as usize],
                    column: point.index[column_axis as usize],
                    along_rows: usize::from(point.axis) == row_axis as usize,
                    kind: point.reason.map_or(0, |reason| 2 + reason as u8),
                });
            }
            // What was rejected lies over what was not.
            for marks in &mut marks {
                asked.ask();
                marks.sort_by_key(|mark| mark.kind != 0);
            }
        }
    }
    marks
}

/// A slice to be drawn from what was stored of it.
pub(crate) struct Sketch<'a> {
    pub(crate) plane: Plane,
    /// Of the volume, along z, y, x.
    pub(crate) shape: [usize; 3],
    pub(crate) step_mm: [f64; 3],
    /// Grey of each row and column.
    pub(crate) shades: &'a Array2<u8>,
    pub(crate) marks: &'a [Mark],
    /// Whether marks are pixels of the slice.
    pub(crate) pixels: bool,
    pub(crate) colours: &'a [Rgb<u8>],
}

/// The picture: as [`picture`] and [`border_picture`] draw it.
pub(crate) fn draw(sketch: &Sketch<'_>) -> RgbImage {
    let Sketch { plane, shape, step_mm, shades, marks, pixels, colours } = *sketch;
    let mut canvas = Canvas::new(plane, shades.dim(), step_mm, |row, column| shades[[row, column]]);
    for mark in marks {
        let colour = colours.get(usize::from(mark.kind)).copied().unwrap_or(REJECTED);
        if pixels {
            canvas.fill(f64::from(mark.row), f64::from(mark.column), (1.0, 1.0), colour);
        } else {
            canvas.cross(plane, shape[0], (mark.row, mark.column), mark.along_rows, colour);
        }
    }
    canvas.image
}

/// A picture that grows, in the rows and columns of its slice.
struct Canvas {
    image: RgbImage,
    /// Pixels of the picture for one row and for one column of the slice.
    scale: (f64, f64),
}

impl Canvas {
    /// The slice of a volume in grey.
    fn of_volume(volume: &Volume, plane: Plane, slice: ArrayView2<'_, i16>) -> Self {
        let step_mm = volume.grid.step().map(norm);
        Self::new(plane, slice.dim(), step_mm, |row, column| grey(slice[[row, column]]))
    }

    /// `shade` gives the grey of a row and a column of the slice; steps are along z, y, x.
    fn new(
        plane: Plane,
        (rows, columns): (usize, usize),
        step_mm: [f64; 3],
        shade: impl Fn(usize, usize) -> u8,
    ) -> Self {
        let (row_axis, column_axis) = axes(plane);
        let mm = |axis: Axis| step_mm[axis as usize];
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
            Rgb([shade(at(height - 1 - y, scale.0, rows), at(x, scale.1, columns)); 3])
        });
        Self { image, scale }
    }

    /// Colours a crossing of the border at those voxel indices along the axes of rows and columns.
    fn cross(
        &mut self,
        plane: Plane,
        nz: usize,
        (row, column): (f32, f32),
        along_rows: bool,
        colour: Rgb<u8>,
    ) {
        let row = f64::from(row);
        #[expect(clippy::cast_precision_loss, reason = "numbers of slices")]
        let row = if axes(plane).0 == Axis::Z { (nz - 1) as f64 - row } else { row };
        // As wide as the line of voxels that it was measured in, so that the contour has no gaps.
        let size = if along_rows { (0.0, 1.0) } else { (1.0, 0.0) };
        self.fill(row, f64::from(column), size, colour);
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

/// The shade of an HU.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to a byte")]
pub(crate) fn grey(hu: i16) -> u8 {
    let (black, white) = WINDOW;
    ((f32::from(hu) - black) / (white - black) * 255.0).clamp(0.0, 255.0) as u8
}
