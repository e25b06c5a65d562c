//! Contours drawn filled into an empty picture.

use super::trace::{BORDER, EXIT};
use crate::pipeline::paper::bitmap::{Bitmap, WHITE};
use crate::pipeline::slices::Pixel;

/// The components inside `contours`, with their holes filled. `traced` is the picture in which the
/// contours were followed.
pub(super) fn filled(traced: &Bitmap, contours: &[Vec<Pixel>]) -> Bitmap {
    let mut picture = Bitmap::new(traced.width(), traced.height());
    let mut rows = (usize::MAX, 0);
    for pixel in contours.iter().flatten() {
        let (row, column) = (pixel.row as usize, pixel.column as usize);
        picture.row_mut(row)[column] = traced.row(row)[column];
        rows = (rows.0.min(row), rows.1.max(row));
    }
    for row in rows.0..=rows.1 {
        let mut inside = false;
        for pixel in picture.row_mut(row) {
            match *pixel {
                BORDER => inside = true,
                EXIT => inside = false,
                _ if !inside => continue,
                _ => {}
            }
            *pixel = WHITE;
        }
    }
    picture
}
