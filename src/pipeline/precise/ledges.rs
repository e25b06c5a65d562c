//! What lies on the skin without a gap: a mask, a strap, a pad, a fiducial.
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

use super::fill;
use super::levels::Levels;
use super::space::Space;
use super::surface::Surface;
use crate::geometry::{add, scale};

/// Between slices further apart a ledge is no steeper than other skin, mm.
const WIDEST_GAP_MM: f64 = 3.5;
/// The fill from which a part may be covered, in links at a node.
const FILLS: [f64; 6] = [0.0, 0.3, 1.0, 2.0, 4.0, 10.0];
/// A rim is no shorter for what it surrounds: least number of nodes on it, of the square root of
/// the number within. It parts what is covered from all that is not.
const LEAST_RIM: f64 = 3.5;
/// Of parts that differ no more in the share of their rims the largest is taken.
const ALIKE: f64 = 0.05;

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
    /// Whether a head has the like of it, which stands off the head: the ears.
    as_ears: bool,
}

/// Masks and straps are larger than ears, noses and lips, fiducials and electrodes smaller. A pad may
/// be as large as an ear; one as large as a chin, from 40 to 57 mm, is not told from it.
const KINDS: [Kind; 3] = [
    Kind {
        extent_mm: 95.0..f64::INFINITY,
        area_mm2: 2000.0,
        compact: 0.0,
        ledge: 0.6,
        roughly: 0.5,
        as_ears: false,
    },
    Kind { extent_mm: 57.0..95.0, area_mm2: 1000.0, compact: 0.2, ledge: 0.8, roughly: 0.7, as_ears: true },
    Kind { extent_mm: 0.0..40.0, area_mm2: 60.0, compact: 0.3, ledge: 0.85, roughly: 0.75, as_ears: false },
];

/// An ear has air behind it, no further away than this, mm,
const BEHIND_MM: f64 = 6.0;
/// over so much of its area.
const AS_EARS: f64 = 0.2;

/// A part of the surface with a ledge around it.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) nodes: Vec<usize>,
    /// Share of its rim that is a ledge.
    pub(super) ledge: f64,
    kind: &'static Kind,
}

impl Part {
    /// The least share that was asked for.
    pub(super) fn limit(&self) -> f64 {
        self.kind.ledge
    }
}

/// The parts with a ledge around them; none has a node in common with another.
pub(super) fn surrounded(space: &Space, levels: &Levels, surface: &mut Surface) -> Vec<Part> {
    if space.gaps().into_iter().all(|gap| gap > WIDEST_GAP_MM) {
        return Vec::new();
    }
    let rough = fill::rough(surface);
    let is_ear =
        |surface: &Surface, part: &Part| part.kind.as_ears && stands_off(space, levels, surface, part);
    let found = parts(surface, &rough, |kind| kind.roughly);
    if found.iter().all(|part| is_ear(surface, part)) {
        return Vec::new();
    }
    let axis = space.slice_axis();
    surface.level_between_slices(&space.gaps(), WIDEST_GAP_MM, |p| space.index(p)[axis]);
    let mut found = parts(surface, &fill::exact(surface, rough), |kind| kind.ledge);
    found.retain(|part| !is_ear(surface, part));
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
            let extent = surface.extent(&nodes);
            let kind = KINDS.iter().find(|kind| kind.extent_mm.contains(&extent))?;
            if nodes.len() < surface.nodes_of(kind.area_mm2.max(kind.compact * extent * extent)) {
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

/// Whether a part has air behind it, as an ear has.
fn stands_off(space: &Space, levels: &Levels, surface: &Surface, part: &Part) -> bool {
    let before_air = |&&node: &&usize| {
        let inward = surface.normals[node].map(|v| -f64::from(v));
        let behind = |mm: f64| space.sample(add(surface.places[node], scale(inward, mm)));
        (2..=BEHIND_MM as u32).any(|mm| behind(f64::from(mm)).is_some_and(|hu| hu < levels.middle()))
    };
    part.nodes.iter().filter(before_air).count() as f64 > AS_EARS * part.nodes.len() as f64
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

#[cfg(test)]
mod tests {
    use super::super::crossings::Crossing;
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
        Surface::of(&crossings, 1.0)
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
