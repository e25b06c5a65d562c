//! What lies on the skin without a gap: a mask, a strap, a pad, a fiducial.
//!
//! No gap and no edge parts such a thing from the skin, but where it ends its outer face stands
//! above the skin beside it: a ledge. A head has ledges of its own, at the lips, the nose, the
//! eyelids, the ears; none of them closes around anything as large as a mask or as compact and small
//! as a fiducial. So every link of the skin's mesh that rises steeply is a source above and a sink
//! below; what they give flows along the skin, not over ledges, and is lost on the way. Sources and
//! sinks of an open ledge cancel each other from a distance. What a closed ledge surrounds fills up;
//! it is taken for covered if nearly all of its rim is indeed a ledge.
//!
//! The wall of a thick pad is wider than the skin that a close look compares it with, so the search is
//! made on a coarse mesh as well.

mod kinds;
mod rim;

use rayon::prelude::*;

pub(crate) use kinds::{CLOSELY, COARSELY, Look};
use kinds::{Kind, Like};
use rim::Rim;

use super::fill;
use super::surface::Surface;
use crate::geometry::{Vec3, add, norm, scale, sub};
use crate::pipeline::precise::scan::levels::Levels;
use crate::pipeline::precise::scan::sampler::Sampler;

/// Between slices further apart a ledge is no steeper than other skin, mm.
const WIDEST_GAP_MM: f64 = 3.5;
/// The fill from which a part may be covered, in links at a node.
const FILLS: [f64; 6] = [0.0, 0.3, 1.0, 2.0, 4.0, 10.0];
/// Of parts that differ no more in the share of their rims the largest is taken.
const ALIKE: f64 = 0.05;

/// What faces one way: least cosine between normals,
const ONE_WAY: f32 = 0.866;
/// of which so many are tried.
const WAYS: usize = 300;

/// An ear has air behind it, no further away than this, mm,
const BEHIND_MM: f64 = 6.0;
/// over so much of its area.
const AS_EARS: f64 = 0.2;

/// A tragus, a wing of the nose and lips are no further than this from where the canal beside them is
/// closed, mm.
const TRAGUS_MM: f64 = 20.0;

/// A part of the surface with a ledge around it.
#[derive(Debug)]
pub(crate) struct Part {
    pub(crate) nodes: Vec<usize>,
    /// Share of its rim that is a ledge.
    pub(crate) ledge: f64,
    kind: &'static Kind,
}

impl Part {
    /// The least share that was asked for.
    pub(crate) fn limit(&self) -> f64 {
        self.kind.ledge
    }

    /// Whether enough of it faces one way.
    fn is_flat(&self, surface: &Surface) -> bool {
        let alike = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2] > ONE_WAY;
        let facing = |i: usize| {
            surface.asked.ask();
            let way = surface.normals[self.nodes[i * self.nodes.len() / WAYS]];
            self.nodes.iter().filter(|&&node| alike(surface.normals[node], way)).count()
        };
        let extent = surface.extent(&self.nodes);
        let most = (0..WAYS).into_par_iter().panic_fuse().map(facing).max().unwrap_or(0);
        most >= surface.nodes_of(self.kind.flat * extent * extent)
    }
}

/// The parts with a ledge around them; none has a node in common with another.
pub(crate) fn surrounded(
    sampler: &Sampler,
    levels: &Levels,
    surface: &mut Surface,
    look: &Look,
    canals: &[Vec3],
) -> Vec<Part> {
    if sampler.gaps().into_iter().all(|gap| gap > WIDEST_GAP_MM) {
        return Vec::new();
    }
    let rough = fill::rough(surface);
    let at_end = at_end(sampler, surface);
    let is_own = |surface: &Surface, part: &Part| match part.kind.like {
        Like::Nothing => false,
        Like::Ear => stands_off(sampler, levels, surface, part),
        Like::Tragus => is_near(surface, part, canals),
    };
    let found = parts(surface, &rough, &at_end, look.kinds, |kind| kind.roughly);
    if found.iter().all(|part| is_own(surface, part)) {
        return Vec::new();
    }
    if look.shows_motion {
        let axis = sampler.slice_axis();
        surface.level_between_slices(&sampler.gaps(), WIDEST_GAP_MM, |p| sampler.index(p)[axis]);
    }
    let mut found = parts(surface, &fill::exact(surface, rough), &at_end, look.kinds, |kind| kind.ledge);
    // What is round beside a mask is the mask's.
    let any_large = found.iter().any(|part| part.kind.flat == 0.0);
    found.retain(|part| (any_large || part.is_flat(surface)) && !is_own(surface, part));
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
fn parts(
    surface: &Surface,
    fill: &[f64],
    at_end: &[bool],
    kinds: &'static [Kind],
    least_ledge: impl Fn(&Kind) -> f64 + Sync,
) -> Vec<Part> {
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
            surface.asked.ask();
            let extent = surface.extent(&nodes);
            let mut kinds = kinds.iter().filter(|kind| kind.has_size(surface, &nodes, extent)).peekable();
            kinds.peek()?;
            let part = part_of[nodes[0]];
            let rim =
                Rim::of(surface, &nodes, |to| part_of[to] != part, |to| is_ledge[to], |node| at_end[node]);
            let long = f64::from(rim.above) / (nodes.len() as f64).sqrt();
            let ledge = rim.share(rim.above);
            let kind = kinds.find(|kind| {
                kind.rim.contains(&long) && ledge >= least_ledge(kind) && rim.steepness() >= kind.steep
            })?;
            Some(Part { nodes, ledge, kind })
        };
        parts.into_iter().filter_map(part).collect()
    };
    let found: Vec<Vec<Part>> = FILLS.par_iter().panic_fuse().map(at).collect();
    found.into_iter().flatten().collect()
}

/// Which nodes are within a leaf of the first or the last slice.
fn at_end(sampler: &Sampler, surface: &Surface) -> Vec<bool> {
    let [up, down] = [surface.leaf, -surface.leaf].map(|mm| scale(sampler.slice_normal(), mm));
    let is_out = |p| sampler.sample(p).is_none();
    surface.places.par_iter().map(|p| is_out(add(*p, up)) || is_out(add(*p, down))).collect()
}

/// Whether a part is no further than [`TRAGUS_MM`] from a canal.
fn is_near(surface: &Surface, part: &Part, canals: &[Vec3]) -> bool {
    let is_near = |node: usize| {
        surface.asked.ask();
        let p = surface.places[node];
        canals.iter().any(|&canal| norm(sub(canal, p)) < TRAGUS_MM)
    };
    part.nodes.iter().any(|&node| is_near(node))
}

/// Whether a part has air behind it, as an ear has.
fn stands_off(sampler: &Sampler, levels: &Levels, surface: &Surface, part: &Part) -> bool {
    let before_air = |&&node: &&usize| {
        sampler.ask_at(node);
        let inward = surface.normals[node].map(|v| -f64::from(v));
        let line = sampler.line(surface.places[node], inward);
        let behind = |mm: f64| line.sample(mm);
        (2..=BEHIND_MM as u32).any(|mm| behind(f64::from(mm)).is_some_and(|hu| hu < levels.middle()))
    };
    part.nodes.iter().filter(before_air).count() as f64 > AS_EARS * part.nodes.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{PlaneSet, normalised};
    use crate::observer::stop::Asked;
    use crate::pipeline::precise::border::crossing::Crossing;

    /// A flat skin of 240 mm with something on it that is so high at x, y.
    fn with(height: impl Fn(f64, f64) -> f64) -> Surface<'static> {
        let crossings: Vec<Crossing> = (0..480 * 480)
            .map(|i| {
                let (x, y) = (f64::from(i % 480) * 0.5 - 120.0, f64::from(i / 480) * 0.5 - 120.0);
                let along = |dx, dy| height(x + dx, y + dy) - height(x - dx, y - dy);
                Crossing {
                    place: [x, y, height(x, y)],
                    normal: normalised([-along(0.5, 0.0), -along(0.0, 0.5), 1.0]).expect("upward"),
                    planes: PlaneSet::EMPTY,
                    axis: 0,
                    between: false,
                    coarseness: 1.0,
                    error: 0.05,
                    level: 0.0,
                }
            })
            .collect();
        Surface::of(Asked::default(), &crossings, 1.0)
    }

    /// A square plate, so many mm from its middle to its edges and 2.5 mm thick; where `slope` it slopes
    /// down to the skin over 25 mm.
    fn plate(half: f64, slope: impl Fn(f64, f64) -> bool) -> Surface<'static> {
        with(|x, y| {
            let beyond = x.abs().max(y.abs()) - half;
            let width = if slope(x, y) { 25.0 } else { 1.0 };
            2.5 * (-beyond / width).clamp(0.0, 1.0)
        })
    }

    /// A disc of 9 mm, 2.5 mm thick, that falls to the skin over so many mm.
    fn disc(slope: f64) -> Surface<'static> {
        with(|x, y| 2.5 * ((9.0 - x.hypot(y)) / slope + 0.5).clamp(0.0, 1.0))
    }

    fn found(surface: &Surface) -> Vec<Part> {
        let fill = fill::exact(surface, fill::rough(surface));
        parts(surface, &fill, &vec![false; surface.len()], &kinds::THIN, |kind| kind.ledge)
    }

    #[test]
    fn what_a_ledge_surrounds_is_covered() {
        let surface = plate(70.0, |_, _| false);
        let largest = found(&surface).into_iter().max_by_key(|part| part.nodes.len()).expect("a plate");
        let within = |node: &&usize| surface.places[**node][..2].iter().all(|v| v.abs() < 70.5);
        let inner = largest.nodes.iter().filter(within).count();
        assert_eq!(inner, largest.nodes.len(), "nothing beside the plate");
        assert!(inner as f64 > 0.9 * 140.0 * 140.0, "{inner} of 19 600 nodes");
        assert!(largest.ledge > 0.9, "{}", largest.ledge);
    }

    #[test]
    fn what_has_a_ledge_on_one_side_alone_is_not() {
        let parts = found(&plate(70.0, |x, _| x < 60.0));
        assert!(parts.is_empty(), "{:?}", parts.iter().map(|p| (p.nodes.len(), p.ledge)).collect::<Vec<_>>());
    }

    #[test]
    fn what_slopes_like_an_eyelid_is_no_fiducial() {
        assert!(!found(&disc(1.0)).is_empty(), "a fiducial");
        assert!(found(&disc(4.0)).is_empty());
    }

    #[test]
    fn what_lies_before_an_ear_canal_may_be_a_tragus() {
        let surface = disc(1.0);
        let part = found(&surface).pop().expect("as compact as a fiducial");
        assert!(is_near(&surface, &part, &[[20.0, 0.0, -5.0]]));
        assert!(!is_near(&surface, &part, &[[40.0, 0.0, -5.0], [0.0, -45.0, 0.0]]));
    }

    /// As large as lips or a nose.
    #[test]
    fn what_is_round_is_no_pad() {
        let of_size = |surface: &Surface| -> Vec<Part> {
            let parts = found(surface);
            parts.into_iter().filter(|part| surface.extent(&part.nodes) > 57.0).collect()
        };
        let pad = plate(23.0, |_, _| false);
        let parts = of_size(&pad);
        assert!(!parts.is_empty() && parts.iter().all(|part| part.is_flat(&pad)));
        let dome = with(|x, y| 9.0 * (1.0 - (x / 31.0).powi(2) - (y / 15.0).powi(2)).max(0.0).sqrt());
        let parts = of_size(&dome);
        assert!(!parts.is_empty(), "it is as large as a pad and has a ledge around it");
        assert!(!parts.iter().any(|part| part.is_flat(&dome)));
    }
}
