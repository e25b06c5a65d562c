//! How the voxels lie in the images.

use ndarray::{ArrayView2, ArrayView3, Axis as Dimension};

use super::super::Options;
use crate::geometry::{Axis, Grid, Plane, Vec3, norm, scale};

/// The axes of the images within the volume.
pub(super) struct Layout<'a> {
    grid: &'a Grid,
    /// Along which the column index grows, and whether against the array's index.
    across: (Axis, bool),
    /// Along which the row index grows.
    down: (Axis, bool),
}

impl<'a> Layout<'a> {
    /// Images as a scanner shows them: axial with the scanner's x to the right and y down,
    /// sagittal with y and −z, coronal with x and −z; the patient's position turns them.
    pub(super) fn new(options: &Options, grid: &'a Grid) -> Self {
        let [x, y, z] = options.acquisition.position.signs();
        // The array runs along +x, −y and −z of the patient.
        let (along_x, along_y, along_z) = ((Axis::X, x < 0.0), (Axis::Y, y > 0.0), (Axis::Z, z < 0.0));
        let (across, down) = match options.acquisition.plane {
            Plane::Axial => (along_x, along_y),
            Plane::Sagittal => (along_y, along_z),
            Plane::Coronal => (along_x, along_z),
        };
        Self { grid, across, down }
    }

    /// Rows and columns.
    pub(super) fn size(&self) -> (usize, usize) {
        let shape = self.grid.shape();
        (shape[self.down.0 as usize], shape[self.across.0 as usize])
    }

    /// Pixel Spacing (0028,0030): distance of rows, distance of columns, mm.
    pub(super) fn pixel_spacing(&self) -> [f64; 2] {
        [self.down, self.across].map(|(axis, _)| norm(self.grid.step()[axis as usize]))
    }

    /// Image Orientation (Patient) (0020,0037): direction of a row, direction of a column.
    pub(super) fn orientation(&self) -> [f64; 6] {
        let [across, down] = [self.across, self.down].map(|(axis, reversed)| {
            let step = self.grid.step()[axis as usize];
            let length = norm(step);
            scale(step, if reversed { -1.0 / length } else { 1.0 / length })
        });
        [across[0], across[1], across[2], down[0], down[1], down[2]]
    }

    /// Image Position (Patient) (0020,0032) of the slice at `index`.
    pub(super) fn position(&self, index: usize) -> Vec3 {
        let mut corner = [0; 3];
        corner[self.grid.slice_axis() as usize] = index;
        for (axis, reversed) in [self.across, self.down] {
            if reversed {
                corner[axis as usize] = self.grid.shape()[axis as usize] - 1;
            }
        }
        self.grid.lps(corner)
    }

    /// The step from slice to slice, mm.
    pub(super) fn slice_step(&self) -> Vec3 {
        self.grid.step()[self.grid.slice_axis() as usize]
    }

    /// The image of the slice at `index`, rows × columns.
    pub(super) fn image<'v>(&self, voxels: &'v ArrayView3<'_, i16>, index: usize) -> ArrayView2<'v, i16> {
        let mut volume = voxels.view();
        for (axis, reversed) in [self.across, self.down] {
            if reversed {
                volume.invert_axis(Dimension(axis as usize));
            }
        }
        let order = [self.grid.slice_axis(), self.down.0, self.across.0].map(|axis| axis as usize);
        volume.permuted_axes(order).index_axis_move(Dimension(0), index)
    }
}
