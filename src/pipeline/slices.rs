//! Slices of a volume: plain views, nothing is interpolated (paper, section 2.1).
//!
//! | plane | one slice per | picture(row, column) |
//! |---|---|---|
//! | axial | z | V(index, row, column) |
//! | sagittal | x | V(nz − 1 − row, column, index) |
//! | coronal | y | V(nz − 1 − row, index, column) |
//!
//! So row 0 is the back of the head in axial slices and the lowest slice (the neck) in the others.

use ndarray::{Array3, ArrayView2};

use crate::geometry::{Axis, Plane};

/// A pixel of a slice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Pixel {
    /// Row, from the top.
    pub row: u32,
    /// Column, from the left.
    pub column: u32,
}

/// Number of slices of `plane` in a volume of `shape = [nz, ny, nx]`.
#[must_use]
pub fn count(shape: [usize; 3], plane: Plane) -> usize {
    shape[axis(plane) as usize]
}

/// The array axis along which the slices of `plane` are counted.
#[must_use]
pub fn axis(plane: Plane) -> Axis {
    match plane {
        Plane::Axial => Axis::Z,
        Plane::Sagittal => Axis::X,
        Plane::Coronal => Axis::Y,
    }
}

/// The slice at `index` as `[[row, column]]`; `None` if there is no such slice.
#[must_use]
pub fn view(hu: &Array3<i16>, plane: Plane, index: usize) -> Option<ArrayView2<'_, i16>> {
    let (nz, ny, nx) = hu.dim();
    if index >= count([nz, ny, nx], plane) {
        return None;
    }
    let mut view = hu.index_axis(ndarray::Axis(axis(plane) as usize), index);
    if plane != Plane::Axial {
        view.invert_axis(ndarray::Axis(0));
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
