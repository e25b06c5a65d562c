//! Points on the true skin, to measure coverage.

use rayon::prelude::*;

use super::anatomy::{Head, Pose};
use crate::geometry::{Grid, Vec3, add, cross, dot, scale, sub};

/// Projects the centre of each cell of a lattice that the skin crosses onto the skin. The lattice
/// stands in LPS.
pub(super) fn points(head: &Head, pose: &Pose, grid: &Grid, spacing: f64) -> Vec<Vec3> {
    let scan = Scan::new(grid);
    let (low, high) = scan.bounds();
    #[expect(clippy::cast_possible_truncation)]
    let first = low.map(|c| (c / spacing).floor() as i64);
    #[expect(clippy::cast_possible_truncation)]
    let last = high.map(|c| (c / spacing).ceil() as i64);
    #[expect(clippy::cast_precision_loss)]
    let at = move |i: i64, j: i64, k: i64| [i, j, k].map(|index| index as f64 * spacing);
    let layers: Vec<Vec<Vec3>> = (first[2]..=last[2])
        .into_par_iter()
        .map(|k| {
            let mut found = Vec::new();
            for j in first[1]..=last[1] {
                let mut i = first[0];
                while i <= last[0] {
                    let centre = at(i, j, k);
                    let value = head.value(pose.to_head(centre)).abs();
                    if value < spacing {
                        found.extend(foot_in_cell(head, pose, centre, spacing));
                    }
                    // Half of what the skin is away at least can be passed over.
                    #[expect(clippy::cast_possible_truncation)]
                    let far = (value / (2.0 * spacing)) as i64;
                    i += far.max(1);
                }
            }
            found
        })
        .collect();
    layers.into_iter().flatten().filter(|&p| scan.contains(p)).collect()
}

/// The skin next to a cell's centre, if it is in that cell.
fn foot_in_cell(head: &Head, pose: &Pose, centre: Vec3, spacing: f64) -> Option<Vec3> {
    let foot = head.foot(pose.to_head(centre));
    let lps = pose.direction_to_lps(foot);
    let within = sub(lps, centre).iter().all(|offset| (-spacing / 2.0..spacing / 2.0).contains(offset));
    (within && head.value(foot).abs() < 1e-3).then_some(lps)
}

/// The parallelepiped of the scan's voxel centres.
struct Scan {
    origin: Vec3,
    edges: [Vec3; 3],
}

impl Scan {
    #[expect(clippy::cast_precision_loss)]
    fn new(grid: &Grid) -> Self {
        let edges = [0, 1, 2].map(|axis| scale(grid.step()[axis], (grid.shape()[axis] - 1) as f64));
        Self { origin: grid.lps([0; 3]), edges }
    }

    /// Its smallest and largest x, y and z.
    fn bounds(&self) -> (Vec3, Vec3) {
        let (mut low, mut high) = (self.origin, self.origin);
        for edge in self.edges {
            low = add(low, edge.map(|c| c.min(0.0)));
            high = add(high, edge.map(|c| c.max(0.0)));
        }
        (low, high)
    }

    fn contains(&self, p: Vec3) -> bool {
        let from = sub(p, self.origin);
        (0..3).all(|axis| {
            let normal = cross(self.edges[(axis + 1) % 3], self.edges[(axis + 2) % 3]);
            (0.0..=1.0).contains(&(dot(normal, from) / dot(normal, self.edges[axis])))
        })
    }
}
