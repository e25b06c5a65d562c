//! Which side of a mesh is outside.

use super::{Feature, doubled_area};
use crate::geometry::{Vec3, add, dot, normalised, scale, sub};

/// Share of the edges between two triangles that may be run through in the same direction by both:
/// real surfaces have a few such spots.
const MAX_INCONSISTENT: f64 = 0.001;

/// Outward normals of faces, edges and corners: those with which the side of the closest point's
/// feature is the side of the surface (Bærentzen and Aanæs 2005: a corner's is weighted by angle).
#[derive(Debug)]
pub(super) struct Orientation {
    faces: Vec<Vec3>,
    edges: Vec<[Vec3; 3]>,
    corners: Vec<Vec3>,
    /// Welded corner of each corner of a face.
    indices: Vec<[u32; 3]>,
}

impl Orientation {
    /// `None` if the triangles' windings contradict each other, so that no side is outside. Where
    /// they agree, but point inward (the enclosed volume is negative), they are turned.
    ///
    /// `faces` are the triangles as indices into `points`, `triangles` the same as corners.
    pub(super) fn new(points: &[Vec3], faces: &[[u32; 3]], triangles: &[[Vec3; 3]]) -> Option<Self> {
        let welded = welded(points);
        let indices: Vec<[u32; 3]> =
            faces.iter().map(|face| face.map(|index| welded[index as usize])).collect();
        let sign = outward_sign(triangles);
        let normals: Vec<Vec3> = triangles
            .iter()
            .map(|triangle| scale(normalised(doubled_area(triangle)).unwrap_or([0.0; 3]), sign))
            .collect();
        let edges = edge_normals(&indices, &normals)?;
        let mut corners = vec![[0.0; 3]; points.len()];
        for ((face, triangle), normal) in indices.iter().zip(triangles).zip(&normals) {
            for corner in 0..3 {
                let [a, b, c] = [0, 1, 2].map(|step| triangle[(corner + step) % 3]);
                let sum = &mut corners[face[corner] as usize];
                *sum = add(*sum, scale(*normal, angle(sub(b, a), sub(c, a))));
            }
        }
        Some(Self { faces: normals, edges, corners, indices })
    }

    /// The outward normal (of any length) of that part of that triangle.
    pub(super) fn normal(&self, triangle: u32, feature: Feature) -> Vec3 {
        let triangle = triangle as usize;
        match feature {
            Feature::Face => self.faces[triangle],
            Feature::Edge(edge) => self.edges[triangle][edge],
            Feature::Corner(corner) => self.corners[self.indices[triangle][corner] as usize],
        }
    }
}

/// For each point the first one in the same place: STL has every corner on its own.
fn welded(points: &[Vec3]) -> Vec<u32> {
    let place = |index: u32| points[index as usize].map(|c| (c + 0.0).to_bits());
    let mut order: Vec<u32> = (0..u32::try_from(points.len()).unwrap_or(u32::MAX)).collect();
    order.sort_unstable_by_key(|&index| (place(index), index));
    let mut welded = vec![0; points.len()];
    for same in order.chunk_by(|&a, &b| place(a) == place(b)) {
        for &index in same {
            welded[index as usize] = same[0];
        }
    }
    welded
}

/// 1 if the triangles enclose a positive volume (their windings point outward), else −1. For an open
/// surface the volume below it, seen from its middle.
fn outward_sign(triangles: &[[Vec3; 3]]) -> f64 {
    let count = 3.0 * triangles.len() as f64;
    let middle = triangles.iter().flatten().fold([0.0; 3], |sum, p| add(sum, *p)).map(|c| c / count);
    let volume: f64 = triangles.iter().map(|t| dot(sub(t[0], middle), doubled_area(t))).sum();
    if volume < 0.0 { -1.0 } else { 1.0 }
}

/// For each edge of each triangle the sum of the normals of the faces that share it.
fn edge_normals(faces: &[[u32; 3]], normals: &[Vec3]) -> Option<Vec<[Vec3; 3]>> {
    // Corners in ascending order, whether the face runs from the lower to the higher, face, edge.
    let mut edges: Vec<([u32; 2], bool, usize, usize)> = faces
        .iter()
        .enumerate()
        .flat_map(|(face, corners)| {
            (0..3).map(move |edge| {
                let (from, to) = (corners[edge], corners[(edge + 1) % 3]);
                ([from.min(to), from.max(to)], from < to, face, edge)
            })
        })
        .collect();
    edges.sort_unstable();
    let mut sums = vec![[[0.0; 3]; 3]; faces.len()];
    let (mut pairs, mut inconsistent) = (0_usize, 0_usize);
    for shared in edges.chunk_by(|a, b| a.0 == b.0) {
        if let [a, b] = shared {
            pairs += 1;
            inconsistent += usize::from(a.1 == b.1);
        }
        let sum = shared.iter().fold([0.0; 3], |sum, edge| add(sum, normals[edge.2]));
        for &(_, _, face, edge) in shared {
            sums[face][edge] = sum;
        }
    }
    (inconsistent as f64 <= MAX_INCONSISTENT * pairs as f64).then_some(sums)
}

/// The angle between two vectors, rad.
fn angle(a: Vec3, b: Vec3) -> f64 {
    crate::geometry::norm(crate::geometry::cross(a, b)).atan2(dot(a, b))
}
