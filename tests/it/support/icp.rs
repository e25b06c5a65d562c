//! A small ICP: point to plane, trimmed, for rigid registration of two surfaces.

use std::collections::HashMap;

use triplanar::geometry::{Vec3, add, cross, dot, norm, scale, sub};

/// Points with unit normals, found by place.
pub(crate) struct Surface {
    points: Vec<(Vec3, Vec3)>,
    cells: HashMap<[i64; 3], Vec<usize>>,
}

/// Edge of a cell, and how far a partner may be, mm.
const CELL: f64 = 4.0;

impl Surface {
    pub(crate) fn new(points: Vec<(Vec3, Vec3)>) -> Self {
        let mut cells: HashMap<_, Vec<usize>> = HashMap::new();
        for (index, (point, _)) in points.iter().enumerate() {
            cells.entry(cell(*point)).or_default().push(index);
        }
        Self { points, cells }
    }

    /// The nearest point with its normal, if there is one within a cell's edge.
    fn nearest(&self, p: Vec3) -> Option<(Vec3, Vec3)> {
        let [x, y, z] = cell(p);
        let around = (-1..=1).flat_map(|a| (-1..=1).flat_map(move |b| (-1..=1).map(move |c| [a, b, c])));
        let candidates = around.filter_map(|[a, b, c]| self.cells.get(&[x + a, y + b, z + c])).flatten();
        let (distance, index) = candidates
            .map(|&index| (norm(sub(self.points[index].0, p)), index))
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        (distance <= CELL).then(|| self.points[index])
    }
}

fn cell(p: Vec3) -> [i64; 3] {
    p.map(|c| (c / CELL).floor() as i64)
}

/// How well two surfaces fit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fit {
    /// mm, of the distances along the target's normals, over the share that was kept.
    pub(crate) rms: f64,
    /// Share of the moving points that have a partner.
    pub(crate) overlap: f64,
}

/// Moves `points` rigidly onto `target`, keeping the best `share` of the pairs in each step.
/// `start` is tried as a shift first.
pub(crate) fn register(points: &[Vec3], target: &Surface, start: Vec3, share: f64) -> Fit {
    let mut moved: Vec<Vec3> = points.iter().map(|p| add(*p, start)).collect();
    let mut fit = Fit { rms: f64::INFINITY, overlap: 0.0 };
    for _ in 0..60 {
        let mut pairs: Vec<(f64, Vec3, Vec3)> = moved
            .iter()
            .filter_map(|p| target.nearest(*p).map(|(q, normal)| (dot(sub(*p, q), normal), *p, normal)))
            .collect();
        if pairs.len() < 100 {
            return fit;
        }
        let overlap = pairs.len() as f64 / points.len() as f64;
        pairs.sort_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
        pairs.truncate((share * pairs.len() as f64) as usize);
        let rms = (pairs.iter().map(|(d, _, _)| d * d).sum::<f64>() / pairs.len() as f64).sqrt();
        fit = Fit { rms, overlap };
        let (turn, shift) = step(&pairs);
        moved.iter_mut().for_each(|p| *p = add(rotated(*p, turn), shift));
        if norm(turn) < 1e-6 && norm(shift) < 1e-4 {
            break;
        }
    }
    fit
}

/// The small rotation (a vector, rad) and shift that reduce the distances most: (p × n, n) · x = −d.
fn step(pairs: &[(f64, Vec3, Vec3)]) -> (Vec3, Vec3) {
    let mut system = [[0.0; 7]; 6];
    for (distance, p, normal) in pairs {
        let arm = cross(*p, *normal);
        let row = [arm[0], arm[1], arm[2], normal[0], normal[1], normal[2], -distance];
        for i in 0..6 {
            for j in 0..7 {
                system[i][j] += row[i] * row[j];
            }
        }
    }
    let x = solve(&mut system);
    ([x[0], x[1], x[2]], [x[3], x[4], x[5]])
}

/// Gauss with pivots; the last column is the right-hand side.
pub(crate) fn solve<const N: usize, const M: usize>(system: &mut [[f64; M]; N]) -> [f64; N] {
    for column in 0..N {
        let pivot = (column..N)
            .max_by(|&a, &b| system[a][column].abs().total_cmp(&system[b][column].abs()))
            .expect("a row");
        system.swap(column, pivot);
        for row in 0..N {
            if row != column {
                let factor = system[row][column] / system[column][column];
                let above = system[column];
                for (value, pivot) in system[row].iter_mut().zip(above) {
                    *value -= factor * pivot;
                }
            }
        }
    }
    std::array::from_fn(|i| system[i][N] / system[i][i])
}

/// Rodrigues' rotation.
fn rotated(p: Vec3, turn: Vec3) -> Vec3 {
    let angle = norm(turn);
    if angle < 1e-12 {
        return p;
    }
    let axis = scale(turn, 1.0 / angle);
    let (sin, cos) = angle.sin_cos();
    let along = scale(axis, dot(axis, p) * (1.0 - cos));
    add(add(scale(p, cos), scale(cross(axis, p), sin)), along)
}
