//! The nearest points of a large cloud: a search tree for each part of it, so that to build them can be
//! stopped between two.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::iter::{IntoParallelIterator, ParallelIterator};

use super::cells::squared_distance;
use crate::observer::stop::{Asked, Stopped, unless_stopped};

/// Points of one tree. One of 2¹⁷ took 167 ms on a busy machine (`cargo bench --bench asks -- FOLDER paper 0.3`).
const MOST_POINTS: usize = 1 << 15;

/// Search trees of parts of a cloud that lie beside each other.
pub(crate) struct Forest(Vec<Tree>);

struct Tree {
    low: [f32; 3],
    high: [f32; 3],
    points: ImmutableKdTree<f32, 3>,
}

impl Forest {
    /// Of all `points`.
    ///
    /// # Errors
    /// [`Stopped`] if it was told to stop.
    pub(crate) fn new(asked: Asked<'_>, points: &[[f32; 3]]) -> Result<Self, Stopped> {
        Self::of_parts(asked, points, MOST_POINTS)
    }

    fn of_parts(asked: Asked<'_>, points: &[[f32; 3]], most: usize) -> Result<Self, Stopped> {
        unless_stopped(|| {
            let mut points = points.to_vec();
            let mut parts = Vec::new();
            part(asked, &mut points, most, &mut parts);
            let trees = parts.into_par_iter().panic_fuse().map(|part| {
                asked.ask();
                Tree::of(asked, part)
            });
            Self(trees.collect())
        })
    }

    /// The squared distances to the `count` points nearest to a place, ascending; to all of them where
    /// there are fewer.
    pub(crate) fn nearest(&self, place: [f32; 3], count: NonZero<usize>) -> Vec<f32> {
        let mut trees: Vec<(f32, &Tree)> = self.0.iter().map(|tree| (tree.beside(place), tree)).collect();
        trees.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut nearest = Vec::new();
        for (beside, tree) in trees {
            if nearest.get(count.get() - 1).is_some_and(|furthest| *furthest <= beside) {
                break;
            }
            let found = tree.points.query(&place).nearest_n::<SquaredEuclidean<f32>>(count).execute();
            nearest.extend(found.iter().map(|other| other.distance));
            nearest.sort_by(f32::total_cmp);
            nearest.truncate(count.get());
        }
        nearest
    }
}

impl Tree {
    fn of(asked: Asked<'_>, points: &[[f32; 3]]) -> Self {
        let [low, high] = bounds(asked, points);
        // The library refuses only more points than its numbers can count.
        let points = ImmutableKdTree::new_from_slice(points).expect("few enough points");
        Self { low, high, points }
    }

    /// The squared distance of a place from the box around all points: no more than that from any of them,
    /// rounding included.
    fn beside(&self, place: [f32; 3]) -> f32 {
        let clamped = [0, 1, 2].map(|axis| place[axis].clamp(self.low[axis], self.high[axis]));
        squared_distance(place, clamped)
    }
}

/// Halves the points along the longest side of the box around them until no part has too many.
fn part<'a>(asked: Asked<'_>, points: &'a mut [[f32; 3]], most: usize, parts: &mut Vec<&'a [[f32; 3]]>) {
    if points.len() <= most {
        return parts.push(points);
    }
    let [low, high] = bounds(asked, points);
    let length = |axis: &usize| high[*axis] - low[*axis];
    let longest = (0..3).max_by(|a, b| length(a).total_cmp(&length(b))).unwrap_or_default();
    let mut compared = 0;
    let middle = points.len() / 2;
    points.select_nth_unstable_by(middle, |a, b| {
        compared += 1;
        asked.ask_at(compared);
        a[longest].total_cmp(&b[longest])
    });
    let (first, second) = points.split_at_mut(middle);
    part(asked, first, most, parts);
    part(asked, second, most, parts);
}

/// The corners of the box around some points.
fn bounds(asked: Asked<'_>, points: &[[f32; 3]]) -> [[f32; 3]; 2] {
    let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for (number, point) in points.iter().enumerate() {
        asked.ask_at(number);
        for axis in 0..3 {
            bounds[0][axis] = bounds[0][axis].min(point[axis]);
            bounds[1][axis] = bounds[1][axis].max(point[axis]);
        }
    }
    bounds
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn many_trees_find_what_one_finds(
            points in prop::collection::vec(prop::array::uniform3(-40_i16..40), 1..400),
            most in 1..50_usize,
            count in 1..60_usize,
        ) {
            let points: Vec<[f32; 3]> = points.into_iter().map(|p| p.map(|v| f32::from(v) * 0.3)).collect();
            let forest = Forest::of_parts(Asked::default(), &points, most).unwrap();
            for &place in &points {
                let mut all: Vec<f32> = points.iter().map(|&other| squared_distance(place, other)).collect();
                all.sort_by(f32::total_cmp);
                all.truncate(count);
                prop_assert_eq!(&forest.nearest(place, NonZero::new(count).unwrap()), &all);
            }
        }
    }
}
