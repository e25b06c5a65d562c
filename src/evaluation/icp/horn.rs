//! The rigid motion that brings points closest to their partners (Horn 1987, with unit
//! quaternions).

use super::Rigid;
use crate::geometry::{Vec3, add, dot, scale, sub};

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

/// Unit eigenvector of the largest eigenvalue of a symmetric matrix, by Jacobi's rotations.
fn leading_eigenvector(mut a: [[f64; 4]; 4]) -> [f64; 4] {
    // Columns are the eigenvectors.
    let mut v: [[f64; 4]; 4] = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    // Converges quadratically: 4 × 4 is done after five or six sweeps.
    for _ in 0..30 {
        let off: f64 = (0..4).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| a[i][j].powi(2)).sum();
        if off == 0.0 {
            break;
        }
        for p in 0..4 {
            for q in p + 1..4 {
                if a[p][q] == 0.0 {
                    continue;
                }
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
                let cos = 1.0 / t.hypot(1.0);
                let sin = t * cos;
                for row in &mut a {
                    (row[p], row[q]) = (cos * row[p] - sin * row[q], sin * row[p] + cos * row[q]);
                }
                for k in 0..4 {
                    (a[p][k], a[q][k]) = (cos * a[p][k] - sin * a[q][k], sin * a[p][k] + cos * a[q][k]);
                }
                for row in &mut v {
                    (row[p], row[q]) = (cos * row[p] - sin * row[q], sin * row[p] + cos * row[q]);
                }
            }
        }
    }
    let largest = (0..4).max_by(|&i, &j| a[i][i].total_cmp(&a[j][j])).unwrap_or(0);
    let vector = v.map(|row| row[largest]);
    let length = vector.iter().map(|c| c * c).sum::<f64>().sqrt();
    if length > 0.0 { vector.map(|c| c / length) } else { [1.0, 0.0, 0.0, 0.0] }
}
