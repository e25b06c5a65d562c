//! How the head is turned in the scanner.

use crate::geometry::Vec3;

/// A rotation about the head's centre, which is the origin of LPS.
#[derive(Debug, Clone)]
pub(in crate::phantom) struct Pose {
    /// Rows: the rotation from head to LPS.
    rotation: [Vec3; 3],
}

impl Pose {
    /// Pitch about x first, then roll about y, then yaw about z; degrees, right-handed in LPS.
    pub(in crate::phantom) fn new(pitch_deg: f64, roll_deg: f64, yaw_deg: f64) -> Self {
        let (sp, cp) = pitch_deg.to_radians().sin_cos();
        let (sr, cr) = roll_deg.to_radians().sin_cos();
        let (sy, cy) = yaw_deg.to_radians().sin_cos();
        // Rz(yaw) · Ry(roll) · Rx(−pitch): a positive pitch lifts the chin.
        let x = [[1.0, 0.0, 0.0], [0.0, cp, sp], [0.0, -sp, cp]];
        let y = [[cr, 0.0, sr], [0.0, 1.0, 0.0], [-sr, 0.0, cr]];
        let z = [[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]];
        Self { rotation: product(z, product(y, x)) }
    }

    /// A point of LPS in the head's own axes.
    #[inline]
    pub(in crate::phantom) fn to_head(&self, p: Vec3) -> Vec3 {
        let r = &self.rotation;
        [0, 1, 2].map(|i| r[0][i] * p[0] + r[1][i] * p[1] + r[2][i] * p[2])
    }

    /// A point or direction of the head in LPS.
    pub(in crate::phantom) fn direction_to_lps(&self, v: Vec3) -> Vec3 {
        self.rotation.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
    }
}

fn product(a: [Vec3; 3], b: [Vec3; 3]) -> [Vec3; 3] {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}
