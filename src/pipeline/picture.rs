//! A slice with its contour, for eyes.

use image::{Rgb, RgbImage};

use super::contour::outline;
use super::mask::mask;
use super::parameters::Parameters;
use super::slices;
use crate::dicom::Volume;
use crate::geometry::Plane;

/// Colour of an accepted contour.
const ACCEPTED: Rgb<u8> = Rgb([0, 255, 0]);
/// Colour of a rejected contour.
const REJECTED: Rgb<u8> = Rgb([255, 0, 0]);
/// HU shown black and white: the soft tissue that the paper's mask looks for, and some more.
const WINDOW: (f32, f32) = (-400.0, 400.0);

/// The slice as radiologists look at it, one pixel a voxel, its contour (if there is one) green for
/// an accepted slice and red for a rejected one. `None` if there is no such slice.
///
/// Upright: anterior at the top of axial slices, the head's top at the top of the others (row 0 of
/// the slice is at the bottom). The patient's right is at the left of axial and coronal slices, the
/// back at the left of sagittal ones.
#[must_use]
pub fn picture(
    volume: &Volume,
    parameters: &Parameters,
    plane: Plane,
    index: usize,
    accepted: bool,
) -> Option<RgbImage> {
    let slice = slices::view(&volume.hu, plane, index)?;
    let (rows, columns) = slice.dim();
    let (height, width) = (u32::try_from(rows).ok()?, u32::try_from(columns).ok()?);
    let mut image = RgbImage::from_fn(width, height, |x, y| {
        let grey = grey(slice[[(height - 1 - y) as usize, x as usize]]);
        Rgb([grey; 3])
    });
    if let Some(outline) = outline(mask(slice, parameters), plane, &parameters.thresholds.contour) {
        let colour = if accepted { ACCEPTED } else { REJECTED };
        for pixel in &outline.contour.pixels {
            image.put_pixel(pixel.column, height - 1 - pixel.row, colour);
        }
    }
    Some(image)
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to a byte")]
fn grey(hu: i16) -> u8 {
    let (black, white) = WINDOW;
    ((f32::from(hu) - black) / (white - black) * 255.0).clamp(0.0, 255.0) as u8
}
