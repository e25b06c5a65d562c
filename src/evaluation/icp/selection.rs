//! Which pairs take part in a round.

use crate::evaluation::target::Nearest;
use crate::geometry::Vec3;

/// Points beyond mean + so many standard deviations are removed.
const DEVIATIONS: f64 = 2.5;

/// How many of `points` the overlap lets take part; at least one.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "between 0 and the number of points"
)]
pub(super) fn overlap_count(points: usize, overlap: f64) -> usize {
    ((points as f64 * overlap.clamp(0.0, 1.0)) as usize).max(1)
}

/// Removes the points farther than mean + 2.5 standard deviations of all distances, in both lists.
pub(super) fn remove_farthest(points: &mut Vec<Vec3>, nearest: &mut Vec<Nearest>) {
    let count = nearest.len() as f64;
    let mean = nearest.iter().map(|n| n.distance).sum::<f64>() / count;
    let variance = nearest.iter().map(|n| (n.distance - mean).powi(2)).sum::<f64>() / count;
    let limit = mean + DEVIATIONS * variance.sqrt();
    if limit.is_finite() {
        let mut distances = nearest.iter().map(|n| n.distance);
        points.retain(|_| distances.next().is_some_and(|distance| distance <= limit));
        nearest.retain(|n| n.distance <= limit);
    }
}

/// Indices of the nearest `limit` ones, in ascending order; those as far as the last of them
/// belong to them.
pub(super) fn nearest_ones(nearest: &[Nearest], limit: usize) -> Vec<usize> {
    if nearest.len() <= limit {
        return (0..nearest.len()).collect();
    }
    let mut distances: Vec<f64> = nearest.iter().map(|n| n.distance).collect();
    let (_, last, _) = distances.select_nth_unstable_by(limit.saturating_sub(1), f64::total_cmp);
    let last = *last;
    (0..nearest.len()).filter(|&index| nearest[index].distance <= last).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(distances: impl IntoIterator<Item = f64>) -> Vec<Nearest> {
        let one = |distance| Nearest { point: [0.0; 3], distance, outside: None, index: 0 };
        distances.into_iter().map(one).collect()
    }

    #[test]
    fn the_overlap_takes_the_nearest_ones_and_their_equals() {
        let nearest = at([3.0, 1.0, 2.0, 2.0, 5.0]);
        assert_eq!(nearest_ones(&nearest, 2), [1, 2, 3]);
        assert_eq!(nearest_ones(&nearest, 5), [0, 1, 2, 3, 4]);
        assert_eq!(overlap_count(76_614, 0.9), 68_952);
    }

    #[test]
    fn removal_takes_what_is_beyond_the_limit_from_both_lists() {
        // Mean 1, variance 9.9: the limit is 8.87.
        let mut nearest = at((0..99).map(|_| 0.9).chain([10.9]));
        let mut points: Vec<Vec3> = (0..100).map(|n| [f64::from(n), 0.0, 0.0]).collect();
        remove_farthest(&mut points, &mut nearest);
        assert_eq!((points.len(), nearest.len(), points[98][0]), (99, 99, 98.0));
        remove_farthest(&mut points, &mut nearest);
        assert!(points.len() >= 99, "equal distances stay");
    }
}
