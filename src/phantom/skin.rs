//! Points on the true skin, to measure coverage.

use rayon::prelude::*;

use super::anatomy::{Head, Pose};
use crate::geometry::{Grid, Vec3, cross, dot, norm, sub};

/// Half the edge of the cube around the origin that holds every head in every pose, mm, and the
/// neck as far as anybody scans it.
const REACH: f64 = 320.0;

/// Projects the centre of each cell of a lattice that the skin crosses onto the skin.
pub(super) fn points(head: &Head, pose: &Pose, grid: &Grid, spacing: f64) -> Vec<Vec3> {
    #[expect(clippy::cast_possible_truncation)]
    let cells = (REACH / spacing).ceil() as i64;
    let inside = Inside::new(grid);
    #[expect(clippy::cast_precision_loss)]
    let at = move |i: i64| i as f64 * spacing;
    let layers: Vec<Vec<Vec3>> = (-cells..cells)
        .into_par_iter()
        .map(|k| {
            let mut found = Vec::new();
            for j in -cells..cells {
                let mut i = -cells;
                while i < cells {
                    let value = head.value([at(i), at(j), at(k)]);
                    if value.abs() < spacing {
                        found.extend(foot_in_cell(head, [at(i), at(j), at(k)], spacing));
                    }
                    // Half of what the surface is away at least can be passed over.
                    #[expect(clippy::cast_possible_truncation)]
                    let far = (value.abs() / (2.0 * spacing)) as i64;
                    i += far.max(1);
                }
            }
            found
        })
        .collect();
    let lps = layers.into_iter().flatten().map(|p| pose.direction_to_lps(p));
    lps.filter(|&p| inside.contains(p)).collect()
}

/// The skin next to a cell's centre, if it is in that cell.
fn foot_in_cell(head: &Head, centre: Vec3, spacing: f64) -> Option<Vec3> {
    let foot = head.foot(centre);
    let within = (0..3).all(|i| {
        let offset = foot[i] - centre[i];
        -spacing / 2.0 <= offset && offset < spacing / 2.0
    });
    (within && head.value(foot).abs() < 1e-3).then_some(foot)
}

/// The parallelepiped of the scan's voxel centres.
struct Inside {
    origin: Vec3,
    /// For each axis: normal of its two faces, scaled so that the far one is at 1.
    faces: [Vec3; 3],
}

impl Inside {
    #[expect(clippy::cast_precision_loss)]
    fn new(grid: &Grid) -> Self {
        let shape = grid.shape();
        let edge = |axis: usize| grid.step()[axis].map(|c| c * (shape[axis] - 1) as f64);
        let edges = [edge(0), edge(1), edge(2)];
        let faces = [0, 1, 2].map(|axis| {
            let normal = cross(edges[(axis + 1) % 3], edges[(axis + 2) % 3]);
            let along = dot(normal, edges[axis]);
            debug_assert!(norm(normal) > 0.0, "a scan has a volume");
            normal.map(|c| c / along)
        });
        Self { origin: grid.lps([0; 3]), faces }
    }

    fn contains(&self, p: Vec3) -> bool {
        let from = sub(p, self.origin);
        self.faces.iter().all(|face| (0.0..=1.0).contains(&dot(*face, from)))
    }
}
