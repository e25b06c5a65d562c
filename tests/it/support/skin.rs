//! A cloud held against the phantom's true skin.

use triplanar::cloud::PointCloud;
use triplanar::geometry::{Vec3, dot, norm, sub};
use triplanar::phantom::Phantom;

use super::icp::solve;

/// How a cloud lies on the true skin. Nothing is registered.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Score {
    /// mm, of the points within 3 mm.
    pub(crate) rms: f64,
    /// Mean signed distance, mm, positive outside, of the same points.
    pub(crate) bias: f64,
    /// Share of the points more than 2 mm off.
    pub(crate) stray: f64,
    /// The shift of the whole cloud (LPS mm) that explains the distances best, next to a constant
    /// depth.
    pub(crate) shift: Vec3,
}

pub(crate) fn score(phantom: &Phantom, cloud: &PointCloud) -> Score {
    let points: Vec<Vec3> = cloud.points.iter().map(|p| p.map(f64::from)).collect();
    let distances: Vec<f64> = points.iter().map(|p| phantom.signed_distance(*p)).collect();
    let near: Vec<(f64, Vec3)> =
        distances.iter().zip(&points).filter(|(d, _)| d.abs() < 3.0).map(|(d, p)| (*d, *p)).collect();
    let mean =
        |value: &dyn Fn(f64) -> f64| near.iter().map(|(d, _)| value(*d)).sum::<f64>() / near.len() as f64;
    // distance = depth + normal · shift, by least squares.
    let mut system = [[0.0; 5]; 4];
    for (distance, p) in &near {
        let n = phantom.normal(*p);
        let row = [n[0], n[1], n[2], 1.0, *distance];
        for i in 0..4 {
            for j in 0..5 {
                system[i][j] += row[i] * row[j];
            }
        }
    }
    let [x, y, z, _] = solve(&mut system);
    Score {
        rms: mean(&|d| d * d).sqrt(),
        bias: mean(&|d| d),
        stray: distances.iter().filter(|d| d.abs() > 2.0).count() as f64 / distances.len() as f64,
        shift: [x, y, z],
    }
}

/// Share of the true skin with a point of the cloud within 1 mm, the 3 mm next to the scan's upper
/// and lower end left out.
pub(crate) fn coverage(phantom: &Phantom, cloud: &PointCloud) -> f64 {
    let mut cells = std::collections::HashMap::<[i64; 3], Vec<Vec3>>::new();
    let cell = |p: Vec3| p.map(|c| c.floor() as i64);
    for point in &cloud.points {
        let point = point.map(f64::from);
        cells.entry(cell(point)).or_default().push(point);
    }
    let grid = phantom.grid();
    let step = norm(grid.step()[0]);
    let down = grid.step()[0].map(|c| c / step);
    let length = step * (grid.shape()[0] - 1) as f64;
    let mut skin = phantom.skin_points(2.0);
    skin.retain(|p| (3.0..length - 3.0).contains(&dot(sub(*p, grid.lps([0; 3])), down)));
    let is_covered = |p: &&Vec3| {
        let [x, y, z] = cell(**p);
        (x - 1..=x + 1).any(|x| {
            (y - 1..=y + 1).any(|y| {
                (z - 1..=z + 1).any(|z| {
                    cells.get(&[x, y, z]).is_some_and(|found| found.iter().any(|q| norm(sub(*q, **p)) < 1.0))
                })
            })
        })
    };
    skin.iter().filter(is_covered).count() as f64 / skin.len() as f64
}
