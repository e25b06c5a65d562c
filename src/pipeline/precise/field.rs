//! The field of view: which part of the images was reconstructed.
//!
//! A scanner reconstructs a circle and fills the rest of the square with one value, marked as padding
//! (PS3.3 section C.7.5.1.1.2) or not. Where the patient reaches that circle there is a border that is
//! no skin.

use rayon::prelude::*;

use super::levels::Levels;
use super::space::Space;

/// A border no more voxels than this from what was filled is none that was measured.
pub(super) const RIM: usize = 2;

/// How far every line of voxels is from one that holds nothing but the fill value.
#[derive(Debug, Default)]
pub(super) struct Field {
    /// For the lines along each axis, by the other two's indices in order: in voxels, the larger of
    /// the two differences; empty where no line is filled.
    distance: [Vec<u8>; 3],
    shape: [usize; 3],
}

impl Field {
    /// Compares every line with those at the corners of the image.
    pub(super) fn of(space: &Space, levels: &Levels) -> Self {
        let mut field = Self { shape: space.shape, ..Self::default() };
        for axis in 0..3 {
            let Some(value) = fill_value(space, levels, axis) else { continue };
            let [rows, columns] = others(axis).map(|a| space.shape[a]);
            let is_filled = |line: usize| {
                let (first, stride) =
                    (start(space, axis, line / columns, line % columns), space.stride(axis));
                (0..space.shape[axis]).all(|i| space.hu[first + i * stride] == value)
            };
            let filled: Vec<bool> = (0..rows * columns).into_par_iter().map(is_filled).collect();
            field.distance[axis] = distances(&filled, columns);
        }
        field
    }

    /// Whether a voxel `[z, y, x]` was reconstructed.
    #[inline]
    pub(super) fn holds(&self, voxel: [usize; 3]) -> bool {
        self.distance(voxel) != Some(0)
    }

    /// How many voxels `[z, y, x]` is from what was not reconstructed; `None` if more than [`RIM`].
    #[inline]
    pub(super) fn distance(&self, voxel: [usize; 3]) -> Option<usize> {
        let along = |axis: usize| {
            let [a, b] = others(axis);
            self.distance[axis].get(voxel[a] * self.shape[b] + voxel[b]).copied()
        };
        (0..3).filter_map(along).min().map(usize::from).filter(|&d| d <= RIM)
    }
}

fn others(axis: usize) -> [usize; 2] {
    [[1, 2], [0, 2], [0, 1]][axis]
}

/// Offset of the first voxel of a line along `axis`.
fn start(space: &Space, axis: usize, row: usize, column: usize) -> usize {
    let [a, b] = others(axis);
    let mut voxel = [0; 3];
    (voxel[a], voxel[b]) = (row, column);
    space.offset(voxel)
}

/// The one value of a whole line at a corner, unless it can be air that was measured.
fn fill_value(space: &Space, levels: &Levels, axis: usize) -> Option<i16> {
    let [a, b] = others(axis).map(|a| space.shape[a] - 1);
    let corners = [[0, 0], [0, b], [a, 0], [a, b]];
    corners.into_iter().find_map(|[row, column]| {
        let (first, stride) = (start(space, axis, row, column), space.stride(axis));
        let value = space.hu[first];
        let is_fill = !levels.is_still_air(f32::from(value))
            && f32::from(value) < levels.middle()
            && (1..space.shape[axis]).all(|i| space.hu[first + i * stride] == value);
        is_fill.then_some(value)
    })
}

/// The distance of every place of a plane from the nearest one that is marked, up to one more than
/// [`RIM`].
fn distances(marked: &[bool], columns: usize) -> Vec<u8> {
    let rows = marked.len() / columns;
    let of = |i: usize| {
        let (row, column) = (i / columns, i % columns);
        let near = |reach: usize| {
            let rows = row.saturating_sub(reach)..(row + reach + 1).min(rows);
            let within = column.saturating_sub(reach)..(column + reach + 1).min(columns);
            rows.into_iter().any(|r| within.clone().any(|c| marked[r * columns + c]))
        };
        (0..=RIM).find(|&reach| near(reach)).unwrap_or(RIM + 1) as u8
    };
    (0..marked.len()).into_par_iter().map(of).collect()
}
