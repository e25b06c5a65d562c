//! Points spread over a mesh by area, without chance.

use super::area;
use crate::geometry::{Vec3, add, scale, sub};

/// More points say nothing more.
const MAX_POINTS: f64 = 2e6;

/// About one point for each `spacing`² mm² of the surface, and at least one.
///
/// The points are equally far apart on the line on which all triangles' areas are strung. Within a
/// triangle they follow the additive recurrence R₂ (Roberts 2018), folded into the triangle.
pub(super) fn sampled(triangles: &[[Vec3; 3]], spacing: f64) -> Vec<Vec3> {
    let total: f64 = triangles.iter().map(area).sum();
    let count = (total / (spacing * spacing)).ceil().clamp(1.0, MAX_POINTS);
    let step = total / count;
    let mut points = Vec::new();
    let (mut end, mut next) = (0.0, step / 2.0);
    for triangle in triangles {
        end += area(triangle);
        while next < end {
            points.push(spread(triangle, points.len()));
            next = step * (points.len() as f64 + 0.5);
        }
    }
    points
}

/// The `index`-th point of the recurrence in the triangle.
fn spread([a, b, c]: &[Vec3; 3], index: usize) -> Vec3 {
    /// The plastic number, the root of x³ = x + 1.
    const PLASTIC: f64 = 1.324_717_957_244_746;
    let n = index as f64 + 1.0;
    let (u, v) = ((n / PLASTIC).fract(), (n / (PLASTIC * PLASTIC)).fract());
    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    add(*a, add(scale(sub(*b, *a), u), scale(sub(*c, *a), v)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_area_gets_its_share() {
        // A small and a large triangle: areas 2 and 50.
        let small = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
        let large = [[0.0, 0.0, 9.0], [10.0, 0.0, 9.0], [0.0, 10.0, 9.0]];
        let points = sampled(&[small, large], 0.1);
        assert_eq!(points.len(), 5200);
        assert_eq!(points.iter().filter(|p| p[2] == 0.0).count(), 200);
        // The centroid of the large one is a third of the way along each leg.
        let mean = |axis: usize| points.iter().filter(|p| p[2] == 9.0).map(|p| p[axis]).sum::<f64>() / 5000.0;
        assert!((mean(0) - 10.0 / 3.0).abs() < 0.02 && (mean(1) - 10.0 / 3.0).abs() < 0.02);
        assert!(points.iter().all(|p| p[0] >= 0.0 && p[1] >= 0.0 && p[0] + p[1] <= 10.0));
    }
}
