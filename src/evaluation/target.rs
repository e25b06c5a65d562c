//! What distances are measured to.

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use serde::Serialize;

use super::Shape;
use super::mesh::Mesh;
use crate::geometry::{Vec3, dot, normalised, sub};

/// Points spread over a mesh for its coverage are so far apart, mm.
const SAMPLE_SPACING_MM: f64 = 0.5;

/// The surface (a mesh) or the points (a cloud) that distances are measured to.
#[derive(Debug)]
pub struct Target(Inner);

#[derive(Debug)]
enum Inner {
    Mesh(Mesh),
    Cloud { tree: ImmutableKdTree<f64, 3>, points: Vec<Vec3>, normals: Option<Vec<Vec3>> },
}

/// Where the sign of a distance comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Sign {
    /// The orientation of the mesh's faces; positive outside.
    Faces,
    /// The normals of the cloud's points: the distance along the nearest point's normal.
    Normals,
    /// Nothing tells which side is outside: distances have no sign.
    None,
}

/// A place's nearest point on a [`Target`].
#[derive(Debug, Clone, Copy)]
pub struct Nearest {
    /// The nearest point, LPS mm.
    pub point: Vec3,
    /// Its distance, mm.
    pub distance: f64,
    /// How far outside the place lies, mm (negative inside); `None` without sides.
    pub outside: Option<f64>,
    /// The triangle or point, a hint for the next query from nearby.
    pub(super) index: u32,
}

impl Target {
    /// `None` if there is neither a triangle with an area nor a point.
    #[must_use]
    pub fn new(shape: &Shape) -> Option<Self> {
        if let Some(mesh) = Mesh::new(&shape.points, &shape.triangles) {
            return Some(Self(Inner::Mesh(mesh)));
        }
        let tree =
            ImmutableKdTree::new_from_slice(&shape.points).ok().filter(|_| !shape.points.is_empty())?;
        let unit = |n: &Vec3| normalised(*n);
        let normals = shape.normals.as_ref().and_then(|normals| normals.iter().map(unit).collect());
        Some(Self(Inner::Cloud { tree, points: shape.points.clone(), normals }))
    }

    /// Where signs come from.
    #[must_use]
    pub fn sign(&self) -> Sign {
        match &self.0 {
            Inner::Mesh(mesh) if mesh.has_sides() => Sign::Faces,
            Inner::Cloud { normals: Some(_), .. } => Sign::Normals,
            _ => Sign::None,
        }
    }

    /// The nearest point of each of `points`, in their order. `hints` are an earlier answer for the
    /// same points from nearby, or empty.
    #[must_use]
    pub fn nearest(&self, points: &[Vec3], hints: &[Nearest]) -> Vec<Nearest> {
        let one = |(index, place): (usize, &Vec3)| self.nearest_one(*place, hints.get(index));
        points.par_iter().enumerate().with_min_len(256).map(one).collect()
    }

    fn nearest_one(&self, place: Vec3, hint: Option<&Nearest>) -> Nearest {
        match &self.0 {
            Inner::Mesh(mesh) => {
                let closest = mesh.closest(place, hint.map(|hint| hint.index));
                Nearest {
                    point: closest.point,
                    distance: closest.squared.sqrt(),
                    outside: mesh.signed_distance(place, &closest),
                    index: closest.triangle,
                }
            }
            Inner::Cloud { tree, points, normals } => {
                let found = tree.query(&place).nearest_one::<SquaredEuclidean<f64>>().execute();
                let index = found.item as usize;
                let along = |normals: &Vec<Vec3>| dot(sub(place, points[index]), normals[index]);
                Nearest {
                    point: points[index],
                    distance: found.distance.sqrt(),
                    outside: normals.as_ref().map(along),
                    index: found.item,
                }
            }
        }
    }

    /// Points that stand for it: a cloud's own, a mesh's spread over it by area, and how far apart
    /// these are, mm.
    #[must_use]
    pub fn samples(&self) -> (Vec<Vec3>, Option<f64>) {
        match &self.0 {
            Inner::Mesh(mesh) => (mesh.sampled(SAMPLE_SPACING_MM), Some(SAMPLE_SPACING_MM)),
            Inner::Cloud { points, .. } => (points.clone(), None),
        }
    }
}
