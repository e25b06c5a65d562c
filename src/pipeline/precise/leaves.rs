//! One point for each leaf, on the skin.

use super::crossings::Crossing;
use crate::geometry::{PlaneSet, Vec3, dot, sub};

/// For every occupied leaf the crossing nearest to the middle of its points, seen along the skin;
/// with the planes of all of them. Leaves are cubes of edge `leaf` mm of a grid through the
/// patient's origin.
#[expect(clippy::cast_possible_truncation)]
pub(super) fn thin(crossings: &[Crossing], leaf: f64) -> Vec<Crossing> {
    let mut keyed: Vec<([i32; 3], u32)> = crossings
        .iter()
        .enumerate()
        .map(|(i, c)| (c.place.map(|v| (v / leaf).floor() as i32), i as u32))
        .collect();
    keyed.sort_unstable();
    keyed.chunk_by(|a, b| a.0 == b.0).map(|group| representative(crossings, group)).collect()
}

fn representative(crossings: &[Crossing], group: &[([i32; 3], u32)]) -> Crossing {
    let (mut middle, mut total, mut normal) = ([0.0; 3], 0.0, [0.0; 3]);
    let mut planes = PlaneSet::EMPTY;
    let member = |g: &([i32; 3], u32)| crossings[g.1 as usize];
    for c in group.iter().map(member) {
        let weight = 1.0 / (c.error * c.error);
        total += weight;
        for a in 0..3 {
            middle[a] += weight * c.place[a];
            normal[a] += c.normal[a];
        }
        planes = planes.union(c.planes);
    }
    let middle: Vec3 = middle.map(|v| v / total);
    let cost = |c: &Crossing| {
        let d = sub(c.place, middle);
        let along = dot(d, c.normal);
        dot(d, d) - along * along + 4.0 * c.error * c.error
    };
    let mut best = member(&group[0]);
    for c in group[1..].iter().map(member) {
        if cost(&c) < cost(&best) {
            best = c;
        }
    }
    Crossing { planes, ..best }
}
