//! A triangle mesh to measure distances to.

mod closest;
mod orientation;
mod sampling;
mod tree;

use crate::geometry::{Vec3, dot, sub};
use closest::{Feature, closest_point};
use orientation::Orientation;
use tree::Tree;

pub(super) use closest::Closest;

/// Triangles in a tree, and their normals where the mesh has a side that is outside.
#[derive(Debug)]
pub(super) struct Mesh {
    triangles: Vec<[Vec3; 3]>,
    tree: Tree,
    orientation: Option<Orientation>,
}

impl Mesh {
    /// Triangles without area are left out; an index beyond the points leaves its triangle out,
    /// too. `None` if no triangle is left.
    pub(super) fn new(points: &[Vec3], triangles: &[[u32; 3]]) -> Option<Self> {
        let (faces, triangles): (Vec<[u32; 3]>, Vec<[Vec3; 3]>) = triangles
            .iter()
            .filter_map(|&face| {
                let [a, b, c] = face.map(|index| points.get(index as usize).copied());
                let corners = [a?, b?, c?];
                (area(&corners) > 0.0).then_some((face, corners))
            })
            .unzip();
        if triangles.is_empty() {
            return None;
        }
        // Neighbours in space become neighbours in memory.
        let (tree, order) = Tree::new(&triangles);
        let faces: Vec<[u32; 3]> = order.iter().map(|&index| faces[index as usize]).collect();
        let triangles: Vec<[Vec3; 3]> = order.iter().map(|&index| triangles[index as usize]).collect();
        let orientation = Orientation::new(points, &faces, &triangles);
        Some(Self { triangles, tree, orientation })
    }

    /// The closest point of the surface. `hint`, a triangle that is probably near, makes it faster
    /// and changes nothing.
    pub(super) fn closest(&self, place: Vec3, hint: Option<u32>) -> Closest {
        self.tree.closest(&self.triangles, place, hint)
    }

    /// Whether the faces tell which side is outside.
    pub(super) fn has_sides(&self) -> bool {
        self.orientation.is_some()
    }

    /// Distance to `closest` (found from `place`), negative inside; `None` where the mesh has no
    /// sides.
    pub(super) fn signed_distance(&self, place: Vec3, closest: &Closest) -> Option<f64> {
        let normal = self.orientation.as_ref()?.normal(closest.triangle, closest.feature);
        let side = dot(sub(place, closest.point), normal);
        Some(closest.squared.sqrt().copysign(side))
    }

    /// About `spacing` mm apart, spread over the surface by area; at least one point.
    pub(super) fn sampled(&self, spacing: f64) -> Vec<Vec3> {
        sampling::sampled(&self.triangles, spacing)
    }
}

/// Twice the vector area of the triangle.
fn doubled_area([a, b, c]: &[Vec3; 3]) -> Vec3 {
    crate::geometry::cross(sub(*b, *a), sub(*c, *a))
}

fn area(corners: &[Vec3; 3]) -> f64 {
    crate::geometry::norm(doubled_area(corners)) / 2.0
}
