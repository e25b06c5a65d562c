//! Area, centroid and convex hull of a contour, taken as the polygon through its pixel centres.

use crate::pipeline::slices::Pixel;

/// Area by Green's formula, px².
#[must_use]
pub fn area(polygon: &[Pixel]) -> f64 {
    (edges(polygon).map(|(p, q)| cross(p, q)).sum::<f64>() * 0.5).abs()
}

/// Centroid `[column, row]` from the polygon's moments, in single precision as the paper's OpenCV
/// gives it. `None` for a polygon without area.
#[must_use]
pub fn centroid(polygon: &[Pixel]) -> Option<[f32; 2]> {
    let [mut twice_area, mut column_moment, mut row_moment] = [0.0_f64; 3];
    for (p, q) in edges(polygon) {
        let cross = cross(p, q);
        twice_area += cross;
        column_moment += cross * (f64::from(p.column) + f64::from(q.column));
        row_moment += cross * (f64::from(p.row) + f64::from(q.row));
    }
    if twice_area == 0.0 {
        return None;
    }
    let sign = twice_area.signum();
    let area = twice_area * (0.5 * sign);
    let sixth = (1.0 / 6.0) * sign;
    #[expect(clippy::cast_possible_truncation, reason = "single precision is what the tests are made for")]
    Some([(column_moment * sixth / area) as f32, (row_moment * sixth / area) as f32])
}

/// Area of the convex hull, px².
#[must_use]
pub fn hull_area(polygon: &[Pixel]) -> f64 {
    area(&convex_hull(polygon))
}

/// The corners of the convex hull (monotone chain over the first and last pixel of each row).
fn convex_hull(polygon: &[Pixel]) -> Vec<Pixel> {
    let (Some(top), Some(bottom)) =
        (polygon.iter().map(|p| p.row).min(), polygon.iter().map(|p| p.row).max())
    else {
        return Vec::new();
    };
    let mut extent = vec![(u32::MAX, 0); (bottom - top) as usize + 1];
    for pixel in polygon {
        let (first, last) = &mut extent[(pixel.row - top) as usize];
        *first = pixel.column.min(*first);
        *last = pixel.column.max(*last);
    }
    let rows = || (top..).zip(&extent).filter(|(_, (first, last))| first <= last);
    let left = chain(rows().map(|(row, &(first, _))| Pixel { row, column: first }), 1.0);
    let right = chain(rows().map(|(row, &(_, last))| Pixel { row, column: last }), -1.0);
    left.into_iter().chain(right.into_iter().rev()).collect()
}

/// One side of the hull, from the top to the bottom, turning one way only.
fn chain(pixels: impl Iterator<Item = Pixel>, turn: f64) -> Vec<Pixel> {
    let mut chain: Vec<Pixel> = Vec::new();
    for pixel in pixels {
        while let [.., a, b] = chain[..] {
            if turned(a, b, pixel) * turn < 0.0 {
                break;
            }
            chain.pop();
        }
        chain.push(pixel);
    }
    chain
}

/// Twice the signed area of the triangle.
fn turned(a: Pixel, b: Pixel, c: Pixel) -> f64 {
    let along =
        |p: Pixel, q: Pixel| (f64::from(q.column) - f64::from(p.column), f64::from(q.row) - f64::from(p.row));
    let ((ux, uy), (vx, vy)) = (along(a, b), along(a, c));
    ux * vy - uy * vx
}

fn cross(p: Pixel, q: Pixel) -> f64 {
    f64::from(p.column) * f64::from(q.row) - f64::from(q.column) * f64::from(p.row)
}

/// The polygon's edges, the closing one first.
pub(crate) fn edges(polygon: &[Pixel]) -> impl Iterator<Item = (Pixel, Pixel)> + '_ {
    let previous = polygon.last().into_iter().chain(polygon);
    previous.copied().zip(polygon.iter().copied())
}
