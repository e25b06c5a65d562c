//! One point per occupied cell of a cubic grid (paper, section 2.3; PCL `VoxelGrid`).

use rayon::slice::ParallelSliceMut;

use crate::cloud::PointCloud;
use crate::geometry::PlaneSet;
use crate::observer::stop::Asked;

/// Cells in the order z, y, x, so that x runs fastest.
type Cell = [i64; 3];

/// The centroid of the points of each occupied cell, ordered by cell with x fastest, and the union
/// of their planes. `unique` of the result is false throughout.
///
/// A point's cell is ⌊p / leaf⌋ − ⌊min / leaf⌋ per axis in single precision, as in PCL, so that the
/// same points share a cell. The centroid is summed in double precision: PCL's single-precision
/// sum depends on the order of the points and is off by up to some 10⁻⁴ mm. There is no limit to
/// the number of cells (PCL returns its input where it exceeds 2³¹).
#[must_use]
pub fn voxel_grid(cloud: &PointCloud, leaf_mm: f32) -> PointCloud {
    voxel_grid_asking(Asked::default(), cloud, leaf_mm)
}

/// The same, asking whether to stop.
pub(super) fn voxel_grid_asking(asked: Asked<'_>, cloud: &PointCloud, leaf_mm: f32) -> PointCloud {
    let inverse = 1.0 / leaf_mm;
    let floor = |p: [f32; 3]| p.map(|v| (v * inverse).floor());
    let points = || cloud.points.iter().zip(0..).inspect(move |&(_, index)| asked.ask_at(index));
    let origin = points().fold([f32::INFINITY; 3], |least, (&p, _)| {
        let cell = floor(p);
        [0, 1, 2].map(|axis| least[axis].min(cell[axis]))
    });
    let mut cells: Vec<(Cell, usize)> = points()
        .map(|(&p, index)| {
            let cell = floor(p);
            ([2, 1, 0].map(|axis| integer(cell[axis] - origin[axis])), index)
        })
        .collect();
    // Each is compared again and again all through the sort.
    cells.par_sort_unstable_by(|a, b| {
        asked.ask_at(a.1);
        a.cmp(b)
    });

    let mut sampled = PointCloud::default();
    for members in cells.chunk_by(|(a, _), (b, _)| a == b) {
        asked.ask_at(sampled.len());
        let (centroid, planes) = merged(cloud, members.iter().map(|&(_, index)| index));
        sampled.points.push(centroid);
        sampled.planes.push(planes);
        sampled.unique.push(false);
    }
    asked.free(cells);
    sampled
}

#[expect(clippy::cast_possible_truncation, reason = "saturates; 2^63 cells are beyond any patient")]
fn integer(cell: f32) -> i64 {
    cell as i64
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "coordinates leave in single precision; a cell holds far fewer than 2^53 points"
)]
fn merged(cloud: &PointCloud, members: impl ExactSizeIterator<Item = usize>) -> ([f32; 3], PlaneSet) {
    let count = members.len() as f64;
    let mut sum = [0.0_f64; 3];
    let mut planes = PlaneSet::EMPTY;
    for index in members {
        for (total, value) in sum.iter_mut().zip(cloud.points[index]) {
            *total += f64::from(value);
        }
        planes = planes.union(cloud.planes[index]);
    }
    (sum.map(|total| (total / count) as f32), planes)
}
