//! The place of every voxel of a volume.

use super::vector::{Vec3, add, scale, sub};

/// An axis of a volume's array `V[[z, y, x]]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Axis {
    /// Slow axis: 0 is the most superior.
    Z = 0,
    /// Middle axis: 0 is the most posterior.
    Y = 1,
    /// Fast axis: 0 is the patient's rightmost.
    X = 2,
}

/// Maps a voxel index `[z, y, x]` to the LPS position of the voxel's centre in mm.
///
/// The array's axes are those of the patient, as near as the scan's own axes come to them: z runs
/// to the feet, y to the front, x to the patient's left. Every acquired slice keeps its own
/// position (ImagePositionPatient), so that gantry tilt (a shear) and variable spacing are exact.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    slice_axis: Axis,
    slice_origins: Vec<Vec3>,
    step: [Vec3; 3],
    shape: [usize; 3],
}

impl Grid {
    /// A grid of `shape = [nz, ny, nx]` voxels.
    ///
    /// `slice_axis` is the axis along which the slices were acquired, `slice_origins` the LPS
    /// centre of the voxel with both other indices 0 for each index on that axis, and `step` the
    /// vectors in mm for one step along z, y, x; the entry of the slice axis is replaced by the
    /// mean step between the origins (kept if there is only one).
    ///
    /// # Panics
    /// If there are not as many origins as the shape has slices (a mistake of the caller).
    #[must_use]
    pub fn new(slice_axis: Axis, slice_origins: Vec<Vec3>, mut step: [Vec3; 3], shape: [usize; 3]) -> Self {
        let n = slice_origins.len();
        assert_eq!(n, shape[slice_axis as usize], "one origin for each acquired slice");
        if n > 1 {
            let whole = sub(slice_origins[n - 1], slice_origins[0]);
            #[expect(clippy::cast_precision_loss)]
            let parts = (n - 1) as f64;
            step[slice_axis as usize] = scale(whole, 1.0 / parts);
        }
        Self { slice_axis, slice_origins, step, shape }
    }

    /// LPS mm of the centre of the voxel at `[z, y, x]`.
    ///
    /// # Panics
    /// If the index on the slice axis is outside the volume.
    #[must_use]
    pub fn lps(&self, index: [usize; 3]) -> Vec3 {
        let mut p = self.slice_origins[index[self.slice_axis as usize]];
        for axis in [Axis::Z, Axis::Y, Axis::X] {
            if axis != self.slice_axis {
                #[expect(clippy::cast_precision_loss)]
                let i = index[axis as usize] as f64;
                p = add(p, scale(self.step[axis as usize], i));
            }
        }
        p
    }

    /// The axis along which the slices were acquired.
    #[must_use]
    pub fn slice_axis(&self) -> Axis {
        self.slice_axis
    }

    /// LPS mm of the first voxel of each acquired slice.
    #[must_use]
    pub fn slice_origins(&self) -> &[Vec3] {
        &self.slice_origins
    }

    /// mm for one step along z, y and x (the mean step along the slice axis).
    #[must_use]
    pub fn step(&self) -> &[Vec3; 3] {
        &self.step
    }

    /// `[nz, ny, nx]`.
    #[must_use]
    pub fn shape(&self) -> [usize; 3] {
        self.shape
    }
}
