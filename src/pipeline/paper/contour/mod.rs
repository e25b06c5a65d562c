//! From a mask to the contour on which the tests decide (paper, section 2.2).

mod fill;
pub mod polygon;
#[cfg(test)]
mod tests;
mod thresholds;
mod trace;

pub use thresholds::ContourThresholds;
pub use trace::external_contours;

use super::bitmap::{BLACK, Bitmap, WHITE};
use crate::geometry::Plane;
use crate::pipeline::slices::Pixel;
use fill::filled;

/// The outermost contour of the head in a slice, without its points on row 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Contour {
    /// Border pixels in the order in which the border is followed.
    pub pixels: Vec<Pixel>,
    /// Area of the polygon through the pixel centres, px².
    pub area: f64,
    /// Centroid of that polygon, `[column, row]`.
    pub centroid: [f32; 2],
    /// Area / area of the convex hull, above 0 to 1.
    pub solidity: f64,
}

/// What the tests look at.
#[derive(Debug, Clone)]
pub struct Outline {
    /// The plane of the slice.
    pub plane: Plane,
    /// The kept contours, filled (white), with the pixels of `contour` marked in it.
    pub picture: Bitmap,
    /// The contour.
    pub contour: Contour,
}

/// Finds the outline of the head in a mask; `None` if no contour is large and central enough.
///
/// 1. External contours of the mask that are large enough and have their centroid in the window.
/// 2. These are drawn filled.
/// 3. A line from the first to the last white pixel of row 0 closes the neck where the image cuts
///    it.
/// 4. Of the external contours of that picture the largest, without its points on row 0.
#[must_use]
pub fn outline(mut mask: Bitmap, plane: Plane, thresholds: &ContourThresholds) -> Option<Outline> {
    let mut kept = external_contours(&mut mask);
    kept.retain(|contour| thresholds.keeps(contour, plane));
    if kept.is_empty() {
        return None;
    }
    let mut picture = filled(&mask, &kept);
    if close_row_0(&mut picture) {
        let mut traced = picture.clone();
        kept = external_contours(&mut traced);
    }
    let contour = cut(largest(kept)?)?;
    picture.mark(&contour.pixels);
    Some(Outline { plane, picture, contour })
}

/// Draws the line; tells whether there was one to draw.
fn close_row_0(picture: &mut Bitmap) -> bool {
    let row = picture.row_mut(0);
    let first = row.iter().position(|&p| p != BLACK);
    let last = row.iter().rposition(|&p| p != BLACK);
    match (first, last) {
        (Some(first), Some(last)) if first < last => {
            row[first..=last].fill(WHITE);
            true
        }
        _ => false,
    }
}

/// The contour of largest area; the first one of several.
fn largest(contours: Vec<Vec<Pixel>>) -> Option<Vec<Pixel>> {
    let mut best: Option<(f64, Vec<Pixel>)> = None;
    for contour in contours {
        let area = polygon::area(&contour);
        if best.as_ref().is_none_or(|(largest, _)| area > *largest) {
            best = Some((area, contour));
        }
    }
    best.map(|(_, contour)| contour)
}

/// Removes the points on row 0 and measures the rest; `None` if nothing with an area is left.
fn cut(mut pixels: Vec<Pixel>) -> Option<Contour> {
    pixels.retain(|p| p.row > 0);
    let area = polygon::area(&pixels);
    let centroid = polygon::centroid(&pixels)?;
    let solidity = area / polygon::hull_area(&pixels);
    Some(Contour { pixels, area, centroid, solidity })
}
