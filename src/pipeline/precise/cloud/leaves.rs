//! One point for each leaf, on the skin.
//!
//! Next to a line that sees the edge clearly one that does not adds nothing but its error, however
//! small the leaf: it stands for none.

use rayon::prelude::*;

use crate::geometry::{PlaneSet, add, dot, scale, sub};
use crate::observer::stop::Asked;
use crate::pipeline::precise::border::crossing::Crossing;
use crate::pipeline::precise::grid::cubes::{groups, key, sorted};

/// The crossing that stands for a leaf.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Leaf {
    /// Its place in the list of crossings.
    pub(crate) crossing: u32,
    /// The planes of all crossings in the leaf.
    pub(crate) planes: PlaneSet,
}

/// Crossings compete with those of the same cube of this edge, mm.
const RIVALS_MM: f64 = 1.0;
/// One with more than so many times the least expected error there drops out.
const CLEAR: f64 = 1.3;

/// Crossings by the cube in which they compete, to make several clouds of.
#[derive(Debug)]
pub(crate) struct Rivals<'a> {
    asked: Asked<'a>,
    crossings: &'a [Crossing],
    /// Each cube with each of its crossings, in order.
    by_cube: Vec<(u64, u32)>,
}

impl<'a> Rivals<'a> {
    /// Sorts all crossings.
    pub(crate) fn of(asked: Asked<'a>, crossings: &'a [Crossing]) -> Self {
        let keyed = |(i, c): (usize, &Crossing)| (key(c.place, RIVALS_MM), i as u32);
        Self { asked, crossings, by_cube: sorted(asked, crossings.par_iter().enumerate().map(keyed)) }
    }

    /// Drops it, asking.
    pub(crate) fn free(self) {
        self.asked.free(self.by_cube);
    }

    /// For every leaf with a crossing for which `member` holds the one nearest to the middle of its
    /// points, seen along the skin. A centroid would lie inside a curved skin; this lies on it. Leaves
    /// are cubes of edge `leaf` mm of a grid through the patient's origin.
    pub(crate) fn thin(&self, leaf: f64, member: impl Fn(&Crossing) -> bool + Sync) -> Vec<Leaf> {
        let cubes = groups(self.asked, &self.by_cube).into_par_iter().panic_fuse();
        let clear = cubes.flat_map_iter(|cube| self.clear(cube, &member));
        let by_leaf = sorted(self.asked, clear.map(|i| (key(self.crossings[i as usize].place, leaf), i)));
        let leaves = groups(self.asked, &by_leaf).into_par_iter().panic_fuse();
        leaves.map(|leaf| self.representative(leaf)).collect()
    }

    fn representative(&self, leaf: &[(u64, u32)]) -> Leaf {
        self.asked.ask_at(leaf[0].1 as usize);
        representative(self.crossings, leaf)
    }

    /// Those members of a cube that see the edge nearly as clearly as the best of them.
    fn clear(&self, cube: &[(u64, u32)], member: impl Fn(&Crossing) -> bool) -> Vec<u32> {
        self.asked.ask_at(cube[0].1 as usize);
        let members = || {
            let all = cube.iter().map(|&(_, i)| (i, &self.crossings[i as usize]));
            all.filter(|(_, c)| member(c)).map(|(i, c)| (i, c.error))
        };
        let least = members().map(|m| m.1).fold(f64::MAX, f64::min);
        members().filter(|m| m.1 <= CLEAR * least).map(|m| m.0).collect()
    }
}

fn representative(crossings: &[Crossing], group: &[(u64, u32)]) -> Leaf {
    let (mut middle, mut total) = ([0.0; 3], 0.0);
    let mut planes = PlaneSet::EMPTY;
    let member = |g: &(u64, u32)| &crossings[g.1 as usize];
    for c in group.iter().map(member) {
        let weight = 1.0 / (c.error * c.error);
        total += weight;
        middle = add(middle, scale(c.place, weight));
        planes = planes.union(c.planes);
    }
    let middle = scale(middle, 1.0 / total);
    let cost = |c: &Crossing| {
        let d = sub(c.place, middle);
        let along = dot(d, c.normal);
        dot(d, d) - along * along + 4.0 * c.error * c.error
    };
    let mut best = (group[0].1, cost(member(&group[0])));
    for g in &group[1..] {
        let cost = cost(member(g));
        if cost < best.1 {
            best = (g.1, cost);
        }
    }
    Leaf { crossing: best.0, planes }
}
