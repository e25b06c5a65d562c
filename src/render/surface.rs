//! Spacing and normals of a cloud's points.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use crate::evaluation::Shape;
use crate::geometry::{Vec3, add, dot, normalised, scale, smallest_eigenvector, sub};

/// Neighbours that a normal is estimated from, the point itself among them.
const NEIGHBOURS: NonZero<usize> = NonZero::new(24).expect("more than none");

/// What drawing needs to know of a cloud.
#[derive(Debug)]
pub(super) struct Surface {
    /// Outward unit normals, one for each point.
    pub(super) normals: Vec<Vec3>,
    /// Whether they come from the file.
    pub(super) has_own_normals: bool,
    /// Discs of this radius close the surface, mm.
    pub(super) radius: f64,
}

impl Surface {
    pub(super) fn new(shape: &Shape) -> Self {
        let tree = ImmutableKdTree::<f64, 3>::new_from_slice(&shape.points).ok();
        let unit = |n: &Vec3| normalised(*n);
        let own: Option<Vec<Vec3>> =
            shape.normals.as_ref().and_then(|normals| normals.iter().map(unit).collect());
        let has_own_normals = own.is_some();
        let (mut normals, mut radius) = (own.unwrap_or_default(), 1.0);
        if let Some(tree) = tree.filter(|_| shape.points.len() > 1) {
            radius = disc_radius(&shape.points, &tree);
            if !has_own_normals {
                normals = estimated(&shape.points, &tree);
            }
        }
        normals.resize(shape.points.len(), [0.0, -1.0, 0.0]);
        Self { normals, has_own_normals, radius }
    }
}

/// On a square grid the fourth neighbour is one step away, and discs of 0.71 steps leave no hole; the
/// rest is for grids that are not square. Dense spots must not decide: three quarters of the points
/// are no sparser.
fn disc_radius(points: &[Vec3], tree: &ImmutableKdTree<f64, 3>) -> f64 {
    const FIFTH: NonZero<usize> = NonZero::new(5).expect("more than none");
    let step = points.len().div_ceil(20_000);
    let mut spacings: Vec<f64> = points
        .par_iter()
        .step_by(step)
        .filter_map(|point| {
            let found = tree.query(point).nearest_n::<SquaredEuclidean<f64>>(FIFTH).execute();
            found.iter().map(|other| other.distance.sqrt()).max_by(f64::total_cmp)
        })
        .collect();
    spacings.sort_unstable_by(f64::total_cmp);
    let spacing = spacings.get(spacings.len() * 3 / 4).copied().unwrap_or(1.0);
    (0.85 * spacing).clamp(0.05, 6.0)
}

/// The direction in which a point's neighbours vary least, away from the middle of all points: right
/// for what is seen of a head.
fn estimated(points: &[Vec3], tree: &ImmutableKdTree<f64, 3>) -> Vec<Vec3> {
    let sum = points.iter().fold([0.0; 3], |sum, p| add(sum, *p));
    let middle = scale(sum, 1.0 / points.len() as f64);
    points
        .par_iter()
        .map(|point| {
            let found = tree.query(point).nearest_n::<SquaredEuclidean<f64>>(NEIGHBOURS).execute();
            let near: Vec<Vec3> = found.iter().map(|other| points[other.item as usize]).collect();
            let centre =
                scale(near.iter().fold([0.0; 3], |sum, p| add(sum, *p)), 1.0 / near.len().max(1) as f64);
            let mut spread = [[0.0; 3]; 3];
            for p in &near {
                let d = sub(*p, centre);
                for i in 0..3 {
                    for j in 0..3 {
                        spread[i][j] += d[i] * d[j];
                    }
                }
            }
            let normal = smallest_eigenvector(spread);
            if dot(normal, sub(*point, middle)) < 0.0 { scale(normal, -1.0) } else { normal }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::norm;

    #[test]
    fn a_spheres_normals_point_outward() {
        let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
        let unit: Vec<Vec3> = (0..4000)
            .map(|n| {
                let z = 1.0 - (2.0 * f64::from(n) + 1.0) / 4000.0;
                let (sin, cos) = (golden * f64::from(n)).sin_cos();
                let r = (1.0 - z * z).sqrt();
                [r * cos, r * sin, z]
            })
            .collect();
        let shape = Shape::cloud(unit.iter().map(|u| add(scale(*u, 80.0), [5.0, -30.0, 9.0])).collect());
        let surface = Surface::new(&shape);
        assert!(!surface.has_own_normals);
        assert!(surface.normals.iter().zip(&unit).all(|(n, u)| norm(sub(*n, *u)) < 0.1));
        // 20 mm² for each point: 4.5 mm apart.
        assert!((3.0..5.5).contains(&surface.radius), "{}", surface.radius);
        let own = Shape { normals: Some(unit.clone()), ..shape };
        assert!(Surface::new(&own).has_own_normals);
    }

    #[test]
    fn few_points_are_no_trouble() {
        for count in 0..4 {
            let surface = Surface::new(&Shape::cloud(vec![[1.0; 3]; count]));
            assert_eq!(surface.normals.len(), count);
        }
    }
}
