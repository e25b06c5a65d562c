//! Eigenvectors of small symmetric matrices.

use super::Vec3;

/// Unit eigenvector of the largest eigenvalue of a symmetric matrix.
pub(crate) fn leading_eigenvector(matrix: [[f64; 4]; 4]) -> [f64; 4] {
    let (values, vectors) = symmetric_eigen(matrix);
    let largest = (0..4).max_by(|&i, &j| values[i].total_cmp(&values[j])).unwrap_or(0);
    vectors.map(|row| row[largest])
}

/// Unit eigenvector of the smallest eigenvalue of a symmetric matrix.
pub(crate) fn smallest_eigenvector(matrix: [Vec3; 3]) -> Vec3 {
    let (values, vectors) = symmetric_eigen(matrix);
    let smallest = (0..3).min_by(|&i, &j| values[i].total_cmp(&values[j])).unwrap_or(0);
    vectors.map(|row| row[smallest])
}

/// Eigenvalues of a symmetric matrix, ascending.
pub(crate) fn eigenvalues(matrix: [Vec3; 3]) -> Vec3 {
    let (mut values, _) = symmetric_eigen(matrix);
    values.sort_by(f64::total_cmp);
    values
}

/// Eigenvalues, and a matrix of which each column is the unit eigenvector of the eigenvalue in its
/// place, by Jacobi's rotations.
fn symmetric_eigen<const N: usize>(mut a: [[f64; N]; N]) -> ([f64; N], [[f64; N]; N]) {
    let mut v: [[f64; N]; N] = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    // Converges quadratically: five or six sweeps do for matrices of this size.
    for _ in 0..30 {
        let mut is_diagonal = true;
        for p in 0..N {
            for q in p + 1..N {
                if a[p][q] == 0.0 {
                    continue;
                }
                is_diagonal = false;
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
                let cos = 1.0 / t.hypot(1.0);
                let sin = t * cos;
                for row in a.iter_mut().chain(&mut v) {
                    (row[p], row[q]) = (cos * row[p] - sin * row[q], sin * row[p] + cos * row[q]);
                }
                let (upper, lower) = a.split_at_mut(q);
                for (x, y) in upper[p].iter_mut().zip(&mut lower[0]) {
                    (*x, *y) = (cos * *x - sin * *y, sin * *x + cos * *y);
                }
            }
        }
        if is_diagonal {
            break;
        }
    }
    (std::array::from_fn(|i| a[i][i]), v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvectors_of_a_known_matrix() {
        // 2·aaᵀ + 5·bbᵀ + 9·ccᵀ of an orthonormal a, b, c.
        let axes = [[2.0, -1.0, 2.0], [2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]].map(|v: Vec3| v.map(|c| c / 3.0));
        let values = [2.0, 5.0, 9.0];
        let mut matrix = [[0.0; 3]; 3];
        for (axis, value) in axes.iter().zip(values) {
            for i in 0..3 {
                for j in 0..3 {
                    matrix[i][j] += value * axis[i] * axis[j];
                }
            }
        }
        let found = smallest_eigenvector(matrix);
        let along: f64 = found.iter().zip(axes[0]).map(|(f, a)| f * a).sum();
        assert!((along.abs() - 1.0).abs() < 1e-12);
        let (found, _) = symmetric_eigen(matrix);
        let mut found = found.to_vec();
        found.sort_by(f64::total_cmp);
        assert!(found.iter().zip(values).all(|(f, v)| (f - v).abs() < 1e-12));
    }
}
