//! Light on what is seen.

use image::Rgb;
use rayon::prelude::*;

use super::splat::Seen;
use crate::geometry::Vec3;

/// Where the light comes from: right, up, to the viewer; over the viewer's left shoulder.
const LIGHT: Vec3 = [-0.36, 0.48, 0.8];
/// Share of a colour that needs no light.
const AMBIENT: f64 = 0.48;
/// How dark what lies deeper than its surroundings gets, per mm.
const DEPTH: f32 = 0.05;

/// The lit colour of each pixel, `None` where nothing is seen. `colours` and `normals` (right, up, to
/// the viewer) are those of the points.
pub(super) fn shade(
    seen: &Seen,
    columns: usize,
    colours: &[[f32; 3]],
    normals: &[Vec3],
) -> Vec<Option<Rgb<u8>>> {
    let pixel = |index: usize| {
        let point = seen.point[index] as usize;
        let (colour, normal) = (colours.get(point)?, normals.get(point)?);
        let lit = normal.iter().zip(LIGHT).map(|(n, l)| n * l).sum::<f64>().max(0.0);
        #[expect(clippy::cast_possible_truncation, reason = "a factor")]
        let light = (AMBIENT + (1.0 - AMBIENT) * lit.powf(0.8)) as f32 * open_sky(seen, columns, index);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        Some(Rgb(colour.map(|c| (c * light * 1.06).clamp(0.0, 255.0) as u8)))
    };
    (0..seen.point.len()).into_par_iter().map(pixel).collect()
}

/// 1 where nothing around is nearer to the viewer, less in folds and beside edges ("eye-dome
/// lighting", Boucheny 2009).
fn open_sky(seen: &Seen, columns: usize, index: usize) -> f32 {
    const AROUND: [[isize; 2]; 8] = [[0, 1], [1, 1], [1, 0], [1, -1], [0, -1], [-1, -1], [-1, 0], [-1, 1]];
    let here = seen.nearness[index];
    let (row, column) = (index / columns, index % columns);
    let rows = seen.nearness.len() / columns;
    let mut above = 0.0;
    for step in [2_isize, 5] {
        for [dy, dx] in AROUND {
            let there = row.checked_add_signed(dy * step).zip(column.checked_add_signed(dx * step));
            if let Some((y, x)) = there.filter(|(y, x)| *y < rows && *x < columns) {
                above += (seen.nearness[y * columns + x] - here).clamp(0.0, 4.0);
            }
        }
    }
    (-DEPTH * above / 2.0).exp()
}
