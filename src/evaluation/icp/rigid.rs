//! Rigid motions.

use crate::geometry::{Vec3, add, dot};

/// A rotation, then a translation, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rigid {
    /// Rows of the rotation matrix.
    pub rotation: [Vec3; 3],
    /// mm, after the rotation about the origin.
    pub translation: Vec3,
}

impl Rigid {
    /// Nothing moves.
    pub const IDENTITY: Self =
        Self { rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], translation: [0.0; 3] };

    /// Where the place goes.
    #[must_use]
    pub fn apply(&self, p: Vec3) -> Vec3 {
        add(self.rotated(p), self.translation)
    }

    /// The place turned about the origin.
    #[must_use]
    pub fn rotated(&self, p: Vec3) -> Vec3 {
        self.rotation.map(|row| dot(row, p))
    }

    /// `first`, then this.
    #[must_use]
    pub fn after(&self, first: &Self) -> Self {
        let column = |axis: usize| self.rotated(first.rotation.map(|row| row[axis]));
        let columns = [column(0), column(1), column(2)];
        Self {
            rotation: [0, 1, 2].map(|row| columns.map(|column| column[row])),
            translation: self.apply(first.translation),
        }
    }

    /// Angle of the rotation about its axis, degrees, 0 to 180.
    #[must_use]
    pub fn angle_deg(&self) -> f64 {
        let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = self.rotation;
        // Twice the sine along the axis: exact for small angles, where the trace is not.
        let sine = crate::geometry::norm([zy - yz, xz - zx, yx - xy]);
        sine.atan2(xx + yy + zz - 1.0).to_degrees()
    }

    /// Row by row, homogeneous.
    #[must_use]
    pub fn matrix(&self) -> [[f64; 4]; 4] {
        let row = |axis: usize| {
            let [x, y, z] = self.rotation[axis];
            [x, y, z, self.translation[axis]]
        };
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }
}
