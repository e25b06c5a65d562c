//! What lies on the skin without a gap: a mask, a strap, a fiducial.
//!
//! No gap and no edge parts such a thing from the skin, but where it ends its outer face stands
//! above the skin beside it: a ledge. A head has ledges of its own, at the lips, the nose, the
//! eyelids, the ears; none of them closes around anything as large as a mask or as compact and small
//! as a fiducial. So every link of the skin's mesh that rises steeply is a source above and a sink
//! below; what they give flows along the skin, not over ledges, and is lost on the way. Sources and
//! sinks of an open ledge cancel each other from a distance. What a closed ledge surrounds fills up;
//! it is taken for covered if nearly all of its rim is indeed a ledge.

use std::ops::Range;

use rayon::prelude::*;

use super::candidates::{BESIDE_MM, Doubtful};
use super::crossings::Crossing;
use super::fill;
use super::leaves::key;
use super::space::Space;
use super::stretches::StretchReason;
use super::surface::Surface;
use crate::geometry::{Vec3, norm, sub};

/// Between slices further apart a ledge is no steeper than other skin, mm.
const WIDEST_GAP_MM: f64 = 3.5;
/// Edge of the mesh's leaves, mm.
const LEAF_MM: f64 = 1.0;
/// The fill from which a part may be covered, in links at a node.
const FILLS: [f64; 6] = [0.0, 0.3, 1.0, 2.0, 4.0, 10.0];
/// What may be covered, by size and by how much of its rim has to be a ledge.
#[derive(Debug)]
struct Kind {
    /// Diagonal of the box around it, mm.
    extent_mm: Range<f64>,
    /// Least area, mm²,
    area_mm2: f64,
    /// and of the square of the diagonal: a fold of the skin is narrow.
    compact: f64,
    /// Least share of the rim that is a ledge.
    ledge: f64,
    /// The same for a closer look.
    roughly: f64,
}

/// Masks and straps are larger than ears, noses and lips, fiducials and electrodes smaller.
const KINDS: [Kind; 2] = [
    Kind { extent_mm: 95.0..f64::INFINITY, area_mm2: 1500.0, compact: 0.0, ledge: 0.6, roughly: 0.5 },
    Kind { extent_mm: 0.0..40.0, area_mm2: 60.0, compact: 0.3, ledge: 0.85, roughly: 0.75 },
];
/// A rim is no shorter for what it surrounds: least number of nodes on it, of the square root of
/// the number within. It parts what is covered from all that is not.
const LEAST_RIM: f64 = 3.5;
/// Of parts that differ no more in the share of their rims the largest is taken.
const ALIKE: f64 = 0.05;
/// Skin so many links away from what is covered is surely none of it,
const NEAR: usize = 16;
/// if it is no island: least diagonal of the box around it, mm.
const LEAST_SKIN_MM: f64 = 150.0;
/// What would be filled further than this from there belongs to it.
const WITHIN: f64 = 0.5;
/// Larger pieces of skin than this may lie apart, mm².
const LARGEST_SCRAP_MM2: f64 = 4000.0;
/// Something foreign is beside a piece if it is near more nodes than this, of the square root of the
/// number within.
const BY_FOREIGN: f64 = 0.5;
/// What is covered reaches so many links beyond its rim: the ledge itself.
const BEYOND: usize = 2;

/// What of the surface is no skin for sure.
#[derive(Debug)]
pub(super) struct Covered {
    /// Leaves, ascending.
    leaves: Vec<(u64, Fate)>,
}

/// Why a leaf is not accepted, what was measured and the limit.
#[derive(Debug, Clone, Copy)]
struct Fate {
    reason: StretchReason,
    measured: f64,
    limit: f64,
}

impl Covered {
    /// Searches the whole surface, whose crossings lie no further apart than a leaf of the mesh.
    /// `near_foreign` tells whether something foreign is close to a place.
    pub(super) fn of(
        space: &Space,
        crossings: &[Crossing],
        near_foreign: impl Fn(Vec3) -> bool + Sync,
    ) -> Self {
        let mut surface = Surface::of(crossings, LEAF_MM);
        let parts = covered(space, &mut surface);
        let mut fates: Vec<Option<Fate>> = vec![None; surface.len()];
        for part in &parts {
            part.nodes.iter().for_each(|&node| fates[node] = Some(part.fate()));
        }
        // What goes with them has no rim of its own.
        if let Some(largest) = parts.iter().max_by_key(|part| part.nodes.len()) {
            let all: Vec<usize> = parts.iter().flat_map(|part| part.nodes.iter().copied()).collect();
            for node in beyond(&surface, completed(&surface, &all), BEYOND) {
                fates[node].get_or_insert(largest.fate());
            }
        }
        let fate = Fate { reason: StretchReason::Touching, measured: 0.0, limit: BESIDE_MM.0 };
        for node in scraps(&surface, near_foreign) {
            fates[node].get_or_insert(fate);
        }
        let leaf = |(node, fate): (usize, Option<Fate>)| Some((surface.leaves[node], fate?));
        Self { leaves: fates.into_iter().enumerate().filter_map(leaf).collect() }
    }

    /// Takes the crossings out that are no skin.
    pub(super) fn take(&self, space: &Space, crossings: &mut Vec<Crossing>) -> Vec<Doubtful> {
        let mut doubtful = Vec::new();
        if !self.leaves.is_empty() {
            crossings.retain(|c| {
                let fate = self.fate(c.place);
                doubtful.extend(fate.map(|Fate { reason, measured, limit }| Doubtful {
                    place: c.place,
                    normal: c.normal,
                    axis: c.axis,
                    inner: space.index(c.place).map(|v| v.round() as u16),
                    reason,
                    measured,
                    limit,
                }));
                fate.is_none()
            });
        }
        doubtful
    }

    fn fate(&self, place: Vec3) -> Option<Fate> {
        let leaf = key(place, LEAF_MM);
        self.leaves.binary_search_by_key(&leaf, |l| l.0).ok().map(|i| self.leaves[i].1)
    }
}

/// A part of the surface with a ledge around it.
#[derive(Debug)]
struct Part {
    nodes: Vec<usize>,
    /// Share of its rim that is a ledge.
    ledge: f64,
    kind: &'static Kind,
}

impl Part {
    fn fate(&self) -> Fate {
        Fate { reason: StretchReason::Covered, measured: self.ledge, limit: self.kind.ledge }
    }
}

/// The parts that something covers; none has a node in common with another.
fn covered(space: &Space, surface: &mut Surface) -> Vec<Part> {
    if space.gaps().into_iter().all(|gap| gap > WIDEST_GAP_MM) {
        return Vec::new();
    }
    let rough = fill::rough(surface);
    if parts(surface, &rough, |kind| kind.roughly).is_empty() {
        return Vec::new();
    }
    let axis = space.slice_axis();
    surface.level_between_slices(&space.gaps(), WIDEST_GAP_MM, |p| space.index(p)[axis]);
    let mut found = parts(surface, &fill::exact(surface, rough), |kind| kind.ledge);
    let mut taken = vec![false; surface.len()];
    let mut chosen = Vec::new();
    loop {
        found.retain(|part| !part.nodes.iter().any(|&node| taken[node]));
        let Some(most) = found.iter().map(|part| part.ledge).max_by(f64::total_cmp) else { break };
        let alike = (0..found.len()).filter(|&i| found[i].ledge >= most - ALIKE);
        let Some(best) = alike.max_by_key(|&i| found[i].nodes.len()) else { break };
        let part = found.swap_remove(best);
        part.nodes.iter().for_each(|&node| taken[node] = true);
        chosen.push(part);
    }
    chosen
}

/// The parts of any kind that are filled to any of the limits and of whose rim at least that share is
/// a ledge.
fn parts(surface: &Surface, fill: &[f64], least_ledge: impl Fn(&Kind) -> f64 + Sync) -> Vec<Part> {
    let is_ledge: Vec<bool> = (0..surface.len())
        .into_par_iter()
        .map(|node| {
            let (steep, all) = surface
                .links(node)
                .fold((0, 0), |(steep, all), link| (steep + usize::from(link.is_ledge()), all + 1));
            3 * steep > all
        })
        .collect();
    let at = |least: &f64| -> Vec<Part> {
        let (part_of, parts) = surface.parts(|node| fill[node] > *least, |_, link| !link.is_ledge());
        let part = |nodes: Vec<usize>| {
            let extent = extent(surface, &nodes);
            let kind = KINDS.iter().find(|kind| kind.extent_mm.contains(&extent))?;
            if nodes.len() < nodes_of(kind.area_mm2.max(kind.compact * extent * extent)) {
                return None;
            }
            let part = part_of[nodes[0]];
            let rim = Rim::of(surface, &nodes, |to| part_of[to] != part, |to| is_ledge[to]);
            let long = f64::from(rim.above) >= LEAST_RIM * (nodes.len() as f64).sqrt();
            let ledge = rim.share(rim.above);
            (ledge >= least_ledge(kind) && long).then_some(Part { nodes, ledge, kind })
        };
        parts.into_iter().filter_map(part).collect()
    };
    let found: Vec<Vec<Part>> = FILLS.par_iter().map(at).collect();
    found.into_iter().flatten().collect()
}

/// How many nodes an area has, mm².
fn nodes_of(area: f64) -> usize {
    (area / (LEAF_MM * LEAF_MM)) as usize
}

/// How many nodes on the rim of a part stand above what is beside it, below it, or level with it.
#[derive(Debug, Default)]
struct Rim {
    above: u32,
    below: u32,
    level: u32,
}

impl Rim {
    /// The rim of some nodes toward those `beside` them; nodes on a ledge are level with nothing.
    fn of(
        surface: &Surface,
        nodes: &[usize],
        beside: impl Fn(usize) -> bool,
        is_ledge: impl Fn(usize) -> bool,
    ) -> Self {
        let mut rim = Self::default();
        for &node in nodes {
            let (mut above, mut below, mut level) = (false, false, false);
            for link in surface.links(node).filter(|link| beside(link.to)) {
                above |= link.is_ledge() && link.rise < 0.0;
                below |= link.is_ledge() && link.rise > 0.0;
                level |= !link.is_ledge() && !is_ledge(link.to);
            }
            rim.above += u32::from(above);
            rim.below += u32::from(below && !above);
            rim.level += u32::from(level);
        }
        rim
    }

    /// The share of so many of the rim's nodes.
    fn share(&self, nodes: u32) -> f64 {
        f64::from(nodes) / f64::from((self.above + self.below + self.level).max(1))
    }
}

/// The nodes of a part with what hangs together with it rather than with the skin further away, as the
/// nose and the lips of a mask do. What lies below in a hole of a mask is skin.
fn completed(surface: &Surface, part: &[usize]) -> Vec<usize> {
    let mut is_in = vec![false; surface.len()];
    part.iter().for_each(|&node| is_in[node] = true);
    let mut is_far = vec![false; surface.len()];
    let (_, others) = surface.parts(|node| !is_in[node], |_, link| !link.is_ledge());
    let large = others.into_iter().filter(|nodes| extent(surface, nodes) >= LEAST_SKIN_MM);
    large.flatten().for_each(|node| is_far[node] = true);
    beyond(surface, part.to_vec(), NEAR).into_iter().for_each(|node| is_far[node] = false);
    let from_part = fill::between(surface, &is_in, &is_far);
    (0..surface.len()).filter(|&node| from_part[node] > WITHIN).collect()
}

/// What is left apart between stretches that something foreign touches or covers: a head's skin hangs
/// together.
fn scraps(surface: &Surface, near_foreign: impl Fn(Vec3) -> bool + Sync) -> Vec<usize> {
    let (_, mut pieces) = surface.parts(|_| true, |_, _| true);
    let largest = pieces.iter().map(Vec::len).max();
    pieces.retain(|nodes| Some(nodes.len()) != largest && nodes.len() < nodes_of(LARGEST_SCRAP_MM2));
    let left = |nodes: &Vec<usize>| {
        let near = nodes.iter().filter(|&&node| near_foreign(surface.places[node])).count();
        near as f64 > BY_FOREIGN * (nodes.len() as f64).sqrt()
    };
    pieces.into_par_iter().filter(left).flatten().collect()
}

/// Diagonal of the box around some nodes, mm.
fn extent(surface: &Surface, nodes: &[usize]) -> f64 {
    let (mut low, mut high): (Vec3, Vec3) = ([f64::MAX; 3], [f64::MIN; 3]);
    for &node in nodes {
        for a in 0..3 {
            low[a] = low[a].min(surface.places[node][a]);
            high[a] = high[a].max(surface.places[node][a]);
        }
    }
    norm(sub(high, low))
}

/// Some nodes and those a few links away.
fn beyond(surface: &Surface, mut all: Vec<usize>, links: usize) -> Vec<usize> {
    let mut is_in = vec![false; surface.len()];
    all.iter().for_each(|&node| is_in[node] = true);
    let mut from = 0;
    for _ in 0..links {
        let to = all.len();
        for i in from..to {
            for link in surface.links(all[i]) {
                if !std::mem::replace(&mut is_in[link.to], true) {
                    all.push(link.to);
                }
            }
        }
        from = to;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::PlaneSet;

    /// A flat skin of 240 mm with a plate of 140 mm on it, 2.5 mm thick; where `slope` it slopes down
    /// to the skin over 25 mm.
    fn plate(slope: impl Fn(f64, f64) -> bool) -> Surface {
        let height = |x: f64, y: f64| {
            let beyond = x.abs().max(y.abs()) - 70.0;
            let width = if slope(x, y) { 25.0 } else { 1.0 };
            2.5 * (-beyond / width).clamp(0.0, 1.0)
        };
        let crossings: Vec<Crossing> = (0..480 * 480)
            .map(|i| {
                let (x, y) = (f64::from(i % 480) * 0.5 - 120.0, f64::from(i / 480) * 0.5 - 120.0);
                Crossing {
                    place: [x, y, height(x, y)],
                    normal: [0.0, 0.0, 1.0],
                    planes: PlaneSet::EMPTY,
                    axis: 0,
                    between: false,
                    coarseness: 1.0,
                    error: 0.05,
                    level: 0.0,
                }
            })
            .collect();
        Surface::of(&crossings, LEAF_MM)
    }

    fn found(surface: &Surface) -> Vec<Part> {
        parts(surface, &fill::exact(surface, fill::rough(surface)), |kind| kind.ledge)
    }

    #[test]
    fn what_a_ledge_surrounds_is_covered() {
        let surface = plate(|_, _| false);
        let largest = found(&surface).into_iter().max_by_key(|part| part.nodes.len()).expect("a plate");
        let within = |node: &&usize| surface.places[**node][..2].iter().all(|v| v.abs() < 70.5);
        let inner = largest.nodes.iter().filter(within).count();
        assert_eq!(inner, largest.nodes.len(), "nothing beside the plate");
        assert!(inner as f64 > 0.9 * 140.0 * 140.0, "{inner} of 19 600 nodes");
        assert!(largest.ledge > 0.9, "{}", largest.ledge);
    }

    #[test]
    fn what_has_a_ledge_on_one_side_alone_is_not() {
        let parts = found(&plate(|x, _| x < 60.0));
        assert!(parts.is_empty(), "{:?}", parts.iter().map(|p| (p.nodes.len(), p.ledge)).collect::<Vec<_>>());
    }
}
