//! Points as small discs, the nearest one wins.

use super::View;
use crate::geometry::Vec3;

/// Where the picture's middle is in the patient, and how large a mm is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Camera {
    pub(super) view: View,
    /// LPS mm of the picture's middle.
    pub(super) middle: Vec3,
    /// Pixels of a mm.
    pub(super) scale: f64,
    /// Columns and rows.
    pub(super) size: [usize; 2],
}

/// What is seen at a pixel: how near (mm towards the viewer, `-∞` for nothing) and of which point.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    pub(super) nearness: Vec<f32>,
    pub(super) point: Vec<u32>,
}

/// Draws each point that `is_shown` as a disc of `radius` mm, at least one pixel. A disc is a little
/// vaulted, so that of neighbours each pixel goes to the point next to it.
#[expect(clippy::cast_possible_truncation, reason = "pixels, and depths in single precision")]
pub(super) fn splat(points: &[Vec3], is_shown: impl Fn(usize) -> bool, radius: f64, camera: &Camera) -> Seen {
    let [columns, rows] = camera.size;
    let mut seen =
        Seen { nearness: vec![f32::NEG_INFINITY; columns * rows], point: vec![u32::MAX; columns * rows] };
    let reach = (radius * camera.scale).max(0.75);
    let middle = camera.view.project(camera.middle);
    for (index, point) in points.iter().enumerate().filter(|(index, _)| is_shown(*index)) {
        let [right, up, nearness] = camera.view.project(*point);
        let x = columns as f64 / 2.0 + (right - middle[0]) * camera.scale;
        let y = rows as f64 / 2.0 - (up - middle[1]) * camera.scale;
        for row in pixels(y, reach, rows) {
            for column in pixels(x, reach, columns) {
                let (dx, dy) = (column as f64 + 0.5 - x, row as f64 + 0.5 - y);
                let off = (dx * dx + dy * dy) / (reach * reach);
                if off > 1.0 {
                    continue;
                }
                let here = (nearness - 0.6 * radius * off) as f32;
                let pixel = row * columns + column;
                if here > seen.nearness[pixel] {
                    seen.nearness[pixel] = here;
                    seen.point[pixel] = index as u32;
                }
            }
        }
    }
    seen
}

/// Pixels whose middle may be within `reach` of `place`.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates at both ends")]
fn pixels(place: f64, reach: f64, count: usize) -> std::ops::Range<usize> {
    let first = (place - reach).floor().max(0.0) as usize;
    let end = (place + reach).ceil().max(0.0) as usize;
    first.min(count)..end.min(count)
}
