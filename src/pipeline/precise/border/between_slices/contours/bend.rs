//! The distance to the contour between two slices: it follows the bend that the slices beyond tell.

use super::{Contours, shift};

/// The bends on both sides of a gap agree up to this ratio; the larger counts no more.
const BEND_RATIO: f64 = 3.0;
/// A contour's way from slice to slice changes by this share of it at most, where one side tells.
const MOST_BENT: f64 = 0.6;
/// And by what so small a radius makes of it, mm.
const LEAST_RADIUS_MM: f64 = 30.0;

impl Contours {
    /// The distance to the contour at pixel `i`, the share `t` of the way from slice k to k + 1, mm. The
    /// straight line between the two would cut off what is curved: the next slices on both sides
    /// tell how much, as far as they agree.
    pub(super) fn distance(&self, k: usize, t: f64, i: usize) -> f64 {
        let (below, above) = (f64::from(self.distances[k][i]), f64::from(self.distances[k + 1][i]));
        let straight = below * (1.0 - t) + above * t;
        let gap = self.gaps[k];
        straight - t * (1.0 - t) * gap * gap * self.bend(k, t, i)
    }

    /// Half the second derivative of the distance across the slices, per mm.
    fn bend(&self, k: usize, t: f64, i: usize) -> f64 {
        let lower = k.checked_sub(1).map_or(f64::NAN, |k| self.second_difference(k, i));
        let upper = if k + 2 < self.distances.len() { self.second_difference(k, i) } else { f64::NAN };
        match (lower.is_finite(), upper.is_finite()) {
            (true, true) if lower * upper > 0.0 => {
                let limit = BEND_RATIO * lower.abs().min(upper.abs());
                let (lower, upper) = (lower.clamp(-limit, limit), upper.clamp(-limit, limit));
                (lower * (2.0 - t) + upper * (1.0 + t)) / 3.0
            }
            (true, false) => self.credible(k, i, lower),
            (false, true) => self.credible(k, i, upper),
            _ => 0.0,
        }
    }

    /// As much of a bend that only one side tells as a round head can have: where the skin is steep it is
    /// little, and grows with the way that the contour moves.
    fn credible(&self, k: usize, i: usize, bend: f64) -> f64 {
        let moved = shift(self.distances[k][i], self.distances[k + 1][i]) / self.gaps[k].powi(2);
        let limit = 0.5 * (MOST_BENT * moved + 1.0 / LEAST_RADIUS_MM);
        bend.clamp(-limit, limit)
    }

    /// The second divided difference of the distances in slices k, k + 1, k + 2, per mm; NaN where one
    /// of them does not know it.
    fn second_difference(&self, k: usize, i: usize) -> f64 {
        let d = |k: usize| f64::from(self.distances[k][i]);
        let (first, second) = (self.gaps[k], self.gaps[k + 1]);
        ((d(k + 2) - d(k + 1)) / second - (d(k + 1) - d(k)) / first) / (first + second)
    }

    /// Where the distance at pixel `i` is 0, as a share of the way from slice k to k + 1.
    pub(super) fn zero(&self, k: usize, i: usize) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        let inside = self.distances[k][i] < 0.0;
        for _ in 0..20 {
            let middle = 0.5 * (low + high);
            if (self.distance(k, middle, i) < 0.0) == inside {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }
}
