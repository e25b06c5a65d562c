//! Indices that can't be taken for each other: cells count along x, y, z; arrays of voxels along z, y, x.

use std::ops::{Index, IndexMut};

/// A cell of a grid along LPS, `[x, y, z]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Cell(pub(crate) [usize; 3]);

/// A voxel of the scan, `[z, y, x]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Voxel(pub(crate) [usize; 3]);

/// A place in the scan in voxels, `[z, y, x]`: whole at their centres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct VoxelPlace(pub(crate) [f64; 3]);

impl Voxel {
    /// Its centre.
    pub(crate) fn centre(self) -> VoxelPlace {
        VoxelPlace(self.0.map(|i| i as f64))
    }

    /// The same in fewer bytes: rows and columns are numbers of 16 bits (PS3.3 section C.7.6.3.1), and slices
    /// are fewer.
    pub(crate) fn short(self) -> [u16; 3] {
        self.0.map(|i| i as u16)
    }
}

impl VoxelPlace {
    /// The nearest voxel; where an index is negative the first one.
    #[inline]
    pub(crate) fn nearest(self) -> Voxel {
        Voxel(self.0.map(|v| ((v + 0.5) as i32).max(0) as usize))
    }

    /// The nearest voxel of a place in the scan, in fewer bytes.
    pub(crate) fn rounded(self) -> [u16; 3] {
        self.0.map(|v| v.round() as u16)
    }
}

/// Access by axis.
macro_rules! by_axis {
    ($($index:ident: $of:ty),+) => {$(
        impl Index<usize> for $index {
            type Output = $of;

            #[inline]
            fn index(&self, axis: usize) -> &$of {
                &self.0[axis]
            }
        }

        impl IndexMut<usize> for $index {
            #[inline]
            fn index_mut(&mut self, axis: usize) -> &mut $of {
                &mut self.0[axis]
            }
        }
    )+};
}

by_axis!(Cell: usize, Voxel: usize, VoxelPlace: f64);
