//! The rigid motion that brings points closest to their partners (Horn 1987, with unit
//! quaternions).

use super::Rigid;
use crate::geometry::{Vec3, add, dot, leading_eigenvector, scale, sub};

/// The motion of the first of each pair that makes the sum of squared distances to the second
/// least. A single place, or none, gives a translation.
pub(super) fn fit(pairs: impl Iterator<Item = (Vec3, Vec3)> + Clone) -> Rigid {
    let (mut count, mut from, mut to) = (0.0, [0.0; 3], [0.0; 3]);
    for (p, q) in pairs.clone() {
        (count, from, to) = (count + 1.0, add(from, p), add(to, q));
    }
    if count == 0.0 {
        return Rigid::IDENTITY;
    }
    let (from, to) = (scale(from, 1.0 / count), scale(to, 1.0 / count));
    // covariance[i][j]: Σ pᵢ qⱼ about the means.
    let mut s = [[0.0; 3]; 3];
    for (p, q) in pairs {
        let (p, q) = (sub(p, from), sub(q, to));
        for i in 0..3 {
            for j in 0..3 {
                s[i][j] += p[i] * q[j];
            }
        }
    }
    let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = s;
    let quaternion = leading_eigenvector([
        [xx + yy + zz, yz - zy, zx - xz, xy - yx],
        [yz - zy, xx - yy - zz, xy + yx, zx + xz],
        [zx - xz, xy + yx, yy - xx - zz, yz + zy],
        [xy - yx, zx + xz, yz + zy, zz - xx - yy],
    ]);
    let rotation = rotation(quaternion);
    let turned = rotation.map(|row| dot(row, from));
    Rigid { rotation, translation: sub(to, turned) }
}

/// The rotation matrix of a unit quaternion `[w, x, y, z]`.
fn rotation([w, x, y, z]: [f64; 4]) -> [Vec3; 3] {
    [
        [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
}
