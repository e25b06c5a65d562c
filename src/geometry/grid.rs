//! The place of every voxel of a volume.

use super::vector::{Vec3, add, dot, norm, scale, sub};

/// What slices may be off even steps for [`Grid::sliced_along`], mm.
const EVEN_MM: f64 = 1e-3;
/// What two axes may be off a right angle there, as a cosine.
const UPRIGHT: f64 = 1e-4;

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

impl Axis {
    /// All three, in the order of the array.
    pub const ALL: [Self; 3] = [Self::Z, Self::Y, Self::X];
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
        for axis in Axis::ALL {
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

    /// The same places with the lines along `axis` in the part of the slices. `None` where that would
    /// move a voxel by more than 0.001 mm, or the axes are not at right angles.
    #[must_use]
    pub fn sliced_along(&self, axis: Axis) -> Option<Self> {
        if axis == self.slice_axis {
            return Some(self.clone());
        }
        let upright = |a: usize, b: usize| {
            let [u, v] = [self.step[a], self.step[b]];
            dot(u, v).abs() <= UPRIGHT * norm(u) * norm(v)
        };
        let first = *self.slice_origins.first()?;
        #[expect(clippy::cast_precision_loss)]
        let even = |(k, &origin): (usize, &Vec3)| {
            let expected = add(first, scale(self.step[self.slice_axis as usize], k as f64));
            norm(sub(origin, expected)) <= EVEN_MM
        };
        if !(upright(0, 1)
            && upright(0, 2)
            && upright(1, 2)
            && self.slice_origins.iter().enumerate().all(even))
        {
            return None;
        }
        #[expect(clippy::cast_precision_loss)]
        let origin = |i: usize| add(first, scale(self.step[axis as usize], i as f64));
        let origins = (0..self.shape[axis as usize]).map(origin).collect();
        Some(Self { slice_axis: axis, slice_origins: origins, ..self.clone() })
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

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: [Vec3; 3] = [[0.0, 0.0, -2.0], [0.0, -0.5, 0.0], [0.7, 0.0, 0.0]];

    fn origins(tilt: f64) -> Vec<Vec3> {
        (0..4).map(f64::from).map(|k| [10.0, 20.0 + tilt * k, 30.0 - 2.0 * k]).collect()
    }

    #[test]
    fn sliced_along_another_axis_no_voxel_moves() {
        let grid = Grid::new(Axis::Z, origins(0.0), STEP, [4, 3, 5]);
        for axis in Axis::ALL {
            let other = grid.sliced_along(axis).expect("even and upright");
            assert_eq!(other.slice_origins().len(), grid.shape()[axis as usize]);
            for (z, y, x) in [(0, 0, 0), (3, 0, 4), (3, 2, 0), (1, 2, 3)] {
                let (a, b) = (grid.lps([z, y, x]), other.lps([z, y, x]));
                assert!(norm(sub(a, b)) < 1e-12, "{a:?} became {b:?}");
            }
        }
    }

    #[test]
    fn a_tilted_or_uneven_stack_has_one_axis_of_slices() {
        let tilted = Grid::new(Axis::Z, origins(0.3), STEP, [4, 3, 5]);
        assert_eq!(tilted.sliced_along(Axis::X), None);
        let mut uneven = origins(0.0);
        uneven[1][2] -= 0.1;
        let uneven = Grid::new(Axis::Z, uneven, STEP, [4, 3, 5]);
        assert_eq!(uneven.sliced_along(Axis::X), None);
        assert_eq!(uneven.sliced_along(Axis::Z).as_ref(), Some(&uneven));
    }
}
