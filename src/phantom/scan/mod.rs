//! The scanner: where the voxels are, and what is measured there.

mod equipment;
mod noise;
mod render;

use crate::geometry::{Axis, Grid, Plane, Vec3, add, scale};

use super::Options;
pub(super) use render::voxels;

/// LPS of the voxel `[0, 0, 0]` and the steps along z, y and x.
struct Frame {
    origin: Vec3,
    step: [Vec3; 3],
}

impl Frame {
    /// Index 0 is the most superior, most posterior and rightmost voxel, as in
    /// [`crate::dicom::Volume`].
    #[expect(clippy::cast_precision_loss)]
    fn new(options: &Options) -> Self {
        let (sin, cos) = options.tilt_deg.to_radians().sin_cos();
        let down = [0.0, 0.0, -options.slice_mm];
        let forward = [0.0, -cos * options.row_mm, -sin * options.row_mm];
        let left = [options.column_mm, 0.0, 0.0];
        let centre = [options.centre_mm[0], options.centre_mm[1], options.top_mm];
        let half = |n: usize| -((n - 1) as f64) / 2.0;
        let to_corner = add(scale(forward, half(options.rows)), scale(left, half(options.columns)));
        Self { origin: add(centre, to_corner), step: [down, forward, left] }
    }

    #[expect(clippy::cast_precision_loss)]
    fn lps(&self, [z, y, x]: [usize; 3]) -> Vec3 {
        let [down, forward, left] = &self.step;
        let at = add(self.origin, scale(*down, z as f64));
        add(at, add(scale(*forward, y as f64), scale(*left, x as f64)))
    }
}

/// Where the voxels are, with the slices of the acquisition.
pub(super) fn grid(options: &Options) -> Grid {
    let frame = Frame::new(options);
    let shape = [options.slices, options.rows, options.columns];
    let axis = match options.acquisition.plane {
        Plane::Axial => Axis::Z,
        Plane::Coronal => Axis::Y,
        Plane::Sagittal => Axis::X,
    };
    let origin = |index: usize| {
        let mut at = [0; 3];
        at[axis as usize] = index;
        frame.lps(at)
    };
    Grid::new(axis, (0..shape[axis as usize]).map(origin).collect(), frame.step, shape)
}
