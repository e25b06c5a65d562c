//! Two clouds or meshes against each other.

use serde::Serialize;

use super::evaluate::target_of;
use super::icp::{self, Registration, Settings};
use super::{Coverage, Distances, Empty, Shape, Sign, Target, Unique};

/// Two shapes against each other.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// From A's points to B.
    pub a_to_b: Direction,
    /// From B's points to A.
    pub b_to_a: Direction,
    /// The larger of the two greatest distances (Hausdorff), mm.
    pub hausdorff_mm: f64,
    /// Of A's points onto B; `None` for fewer than 4 points.
    pub registration: Option<Registration>,
}

/// One shape's points against the other shape.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Direction {
    /// Where the signs of these distances come from.
    pub sign: Sign,
    /// From the one's points to the other, without registration.
    pub distances: Distances,
    /// The one's points without a point of the other within 1 mm.
    pub unique: Unique,
    /// How much of the other the one's points cover.
    pub coverage: Coverage,
}

/// Compares the points of each with the other (points or surface); all LPS mm.
///
/// # Errors
/// [`Empty`] if one of them has no point.
pub fn compare(a: &Shape, b: &Shape, settings: Settings) -> Result<Comparison, Empty> {
    let surface_a = Target::new(a).ok_or(Empty("the first cloud"))?;
    let surface_b = Target::new(b).ok_or(Empty("the second cloud"))?;
    let a_to_b = direction(a, b, &surface_b).ok_or(Empty("the first cloud"))?;
    let b_to_a = direction(b, a, &surface_a).ok_or(Empty("the second cloud"))?;
    Ok(Comparison {
        hausdorff_mm: a_to_b.distances.max_mm.max(b_to_a.distances.max_mm),
        a_to_b,
        b_to_a,
        registration: icp::register(&a.points, &surface_b, settings),
    })
}

fn direction(from: &Shape, to: &Shape, target: &Target) -> Option<Direction> {
    Some(Direction {
        sign: target.sign(),
        distances: Distances::new(&target.nearest(&from.points, &[]))?,
        unique: Unique::new(&from.points, &to.points),
        coverage: Coverage::new(target, &target_of(&from.points)?),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_direction_has_its_own_figures() {
        let line = |count: i32, height: f64| {
            Shape::cloud((0..count).map(|n| [f64::from(n), height, f64::from(n % 3)]).collect())
        };
        let (a, b) = (line(30, 0.0), line(20, 0.5));
        let found = compare(&a, &b, Settings::PAPER).unwrap();
        assert_eq!(found.b_to_a.distances.max_mm, 0.5);
        assert!(found.a_to_b.distances.max_mm > 10.0);
        assert_eq!(found.hausdorff_mm, found.a_to_b.distances.max_mm);
        assert_eq!((found.a_to_b.unique.points, found.b_to_a.unique.points), (10, 0));
        assert_eq!(found.a_to_b.coverage.within_1_mm, 1.0);
        assert!((found.b_to_a.coverage.within_1_mm - 20.0 / 30.0).abs() < 1e-12);
        assert_eq!(compare(&a, &Shape::default(), Settings::PAPER), Err(Empty("the second cloud")));
    }
}
