//! Slices of a volume: plain views, nothing is interpolated (paper, section 2.1).
//!
//! | plane | one slice per | picture(row, column) |
//! |---|---|---|
//! | axial | z | V(index, row, column) |
//! | sagittal | x | V(nz − 1 − row, column, index) |
//! | coronal | y | V(nz − 1 − row, index, column) |
//!
//! So row 0 is the back of the head in axial slices and the lowest slice (the neck) in the others.

use ndarray::{Array3, ArrayView2, Axis};

use super::contour::Pixel;
use crate::geometry::Plane;

/// Number of slices of `plane` in a volume of `shape = [nz, ny, nx]`.
#[must_use]
pub fn count(shape: [usize; 3], plane: Plane) -> usize {
    match plane {
        Plane::Axial => shape[0],
        Plane::Sagittal => shape[2],
        Plane::Coronal => shape[1],
    }
}

/// The slice at `index` as `[[row, column]]`; `None` if there is no such slice.
#[must_use]
pub fn view(hu: &Array3<i16>, plane: Plane, index: usize) -> Option<ArrayView2<'_, i16>> {
    let (nz, ny, nx) = hu.dim();
    if index >= count([nz, ny, nx], plane) {
        return None;
    }
    let mut view = match plane {
        Plane::Axial => hu.index_axis(Axis(0), index),
        Plane::Sagittal => hu.index_axis(Axis(2), index),
        Plane::Coronal => hu.index_axis(Axis(1), index),
    };
    if plane != Plane::Axial {
        view.invert_axis(Axis(0));
    }
    Some(view)
}

/// The voxel `[z, y, x]` that a pixel of a slice shows.
#[must_use]
pub fn voxel(shape: [usize; 3], plane: Plane, index: usize, pixel: Pixel) -> [usize; 3] {
    let (row, column) = (pixel.row as usize, pixel.column as usize);
    match plane {
        Plane::Axial => [index, row, column],
        Plane::Sagittal => [shape[0] - 1 - row, column, index],
        Plane::Coronal => [shape[0] - 1 - row, index, column],
    }
}
