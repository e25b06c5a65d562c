//! The point of a triangle that is closest to a place
//! (Ericson, Real-Time Collision Detection, section 5.1.5: by the regions around the triangle).

use crate::geometry::{Vec3, add, dot, scale, sub};

/// Which part of a triangle a closest point lies on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::evaluation) enum Feature {
    /// The inside.
    Face,
    /// The edge from corner `n` to the next.
    Edge(usize),
    /// Corner `n`.
    Corner(usize),
}

/// A place's closest point on a mesh.
#[derive(Debug, Clone, Copy)]
pub(in crate::evaluation) struct Closest {
    /// The closest point.
    pub(in crate::evaluation) point: Vec3,
    /// Its squared distance, mm².
    pub(in crate::evaluation) squared: f64,
    /// The triangle it lies on.
    pub(in crate::evaluation) triangle: u32,
    /// Where on that triangle.
    pub(super) feature: Feature,
}

/// The closest point of a triangle, and where on it that is.
pub(super) fn closest_point(p: Vec3, [a, b, c]: &[Vec3; 3]) -> (Vec3, Feature) {
    let (ab, ac) = (sub(*b, *a), sub(*c, *a));
    let ap = sub(p, *a);
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (*a, Feature::Corner(0));
    }
    let bp = sub(p, *b);
    let (d3, d4) = (dot(ab, bp), dot(ac, bp));
    if d3 >= 0.0 && d4 <= d3 {
        return (*b, Feature::Corner(1));
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (add(*a, scale(ab, d1 / (d1 - d3))), Feature::Edge(0));
    }
    let cp = sub(p, *c);
    let (d5, d6) = (dot(ab, cp), dot(ac, cp));
    if d6 >= 0.0 && d5 <= d6 {
        return (*c, Feature::Corner(2));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (add(*a, scale(ac, d2 / (d2 - d6))), Feature::Edge(2));
    }
    let va = d3 * d6 - d5 * d4;
    let (along_b, along_c) = (d4 - d3, d5 - d6);
    if va <= 0.0 && along_b >= 0.0 && along_c >= 0.0 {
        let t = along_b / (along_b + along_c);
        return (add(*b, scale(sub(*c, *b), t)), Feature::Edge(1));
    }
    let inverse = 1.0 / (va + vb + vc);
    (add(*a, add(scale(ab, vb * inverse), scale(ac, vc * inverse))), Feature::Face)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::norm;

    /// A right angle at the origin, legs of 4 along x and 3 along y.
    const TRIANGLE: [Vec3; 3] = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 3.0, 0.0]];

    #[test]
    fn each_region_gives_its_part_of_the_triangle() {
        for (place, point, feature) in [
            ([1.0, 1.0, 5.0], [1.0, 1.0, 0.0], Feature::Face),
            ([-1.0, -1.0, 1.0], TRIANGLE[0], Feature::Corner(0)),
            ([6.0, -1.0, 0.0], TRIANGLE[1], Feature::Corner(1)),
            ([-1.0, 6.0, -2.0], TRIANGLE[2], Feature::Corner(2)),
            ([2.0, -3.0, 1.0], [2.0, 0.0, 0.0], Feature::Edge(0)),
            // Off the middle of the hypotenuse, along its normal (3, 4).
            ([2.0 + 3.0, 1.5 + 4.0, 1.0], [2.0, 1.5, 0.0], Feature::Edge(1)),
            ([-2.0, 2.0, 0.0], [0.0, 2.0, 0.0], Feature::Edge(2)),
        ] {
            let (found, part) = closest_point(place, &TRIANGLE);
            assert!(norm(sub(found, point)) < 1e-12 && part == feature, "{place:?}: {found:?} {part:?}");
        }
    }
}
