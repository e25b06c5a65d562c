//! One point for each leaf, on the skin.
//!
//! Next to a line that sees the edge clearly one that does not adds nothing but its error, however
//! small the leaf: it stands for none.

use rayon::prelude::*;

use super::crossings::Crossing;
use crate::geometry::{PlaneSet, Vec3, add, dot, scale, sub};

/// The crossing that stands for a leaf.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leaf {
    /// Its place in the list of crossings.
    pub(super) crossing: u32,
    /// The planes of all crossings in the leaf.
    pub(super) planes: PlaneSet,
}

/// Crossings compete with those of the same cube of this edge, mm.
const RIVALS_MM: f64 = 1.0;
/// One with more than so many times the least expected error there drops out.
const CLEAR: f64 = 1.3;

/// For every leaf with a crossing for which `member` holds the one nearest to the middle of its
/// points, seen along the skin. A centroid would lie inside a curved skin; this lies on it. Leaves
/// are cubes of edge `leaf` mm of a grid through the patient's origin.
pub(super) fn thin(
    crossings: &[Crossing],
    leaf: f64,
    member: impl Fn(&Crossing) -> bool + Sync,
) -> Vec<Leaf> {
    let members = (0..crossings.len() as u32).into_par_iter().filter(|&i| member(&crossings[i as usize]));
    let rivals = by_cube(crossings, RIVALS_MM, members);
    let groups: Vec<&[(u64, u32)]> = rivals.chunk_by(|a, b| a.0 == b.0).collect();
    let clear = groups.into_par_iter().flat_map_iter(|group| clear(crossings, group));
    let leaves = by_cube(crossings, leaf, clear);
    let groups: Vec<&[(u64, u32)]> = leaves.chunk_by(|a, b| a.0 == b.0).collect();
    groups.into_par_iter().map(|group| representative(crossings, group)).collect()
}

/// The cube of edge `edge` mm of each member, with the member, in order.
fn by_cube(crossings: &[Crossing], edge: f64, members: impl ParallelIterator<Item = u32>) -> Vec<(u64, u32)> {
    let mut keyed: Vec<(u64, u32)> = members.map(|i| (key(crossings[i as usize].place, edge), i)).collect();
    keyed.par_sort_unstable();
    keyed
}

/// Those of a cube that see the edge nearly as clearly as the best of them.
fn clear<'a>(crossings: &'a [Crossing], group: &'a [(u64, u32)]) -> impl Iterator<Item = u32> + 'a {
    let error = |i: u32| crossings[i as usize].error;
    let least = group.iter().map(|g| error(g.1)).fold(f64::MAX, f64::min);
    group.iter().map(|g| g.1).filter(move |&i| error(i) <= CLEAR * least)
}

/// A key for the cube of edge `leaf` mm that holds a place in single precision, as a cloud has it; far
/// beyond any scanner's bore two cubes may share one.
pub(super) fn key(p: Vec3, leaf: f64) -> u64 {
    let cell = |v: f64| {
        let v = f64::from(v as f32);
        // `floor` is a call where the target has no instruction for it.
        let (q, whole) = (v / leaf, (v / leaf) as i64);
        (whole - i64::from(q < whole as f64) + (1 << 20)) as u64 & 0x1F_FFFF
    };
    cell(p[2]) << 42 | cell(p[1]) << 21 | cell(p[0])
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
