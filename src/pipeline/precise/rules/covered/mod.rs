//! What of the surface is no skin although it is the patient's border: what a ledge surrounds, what
//! goes with it, and the scraps between rejected stretches.

use rayon::prelude::*;

use super::touching::BESIDE_MM;
use crate::geometry::Vec3;
use crate::pipeline::precise::border::crossing::Crossing;
use crate::pipeline::precise::border::rejected::Rejected;
use crate::pipeline::precise::grid::cubes::key;
use crate::pipeline::precise::labels::slender::{Slender, is_enough};
use crate::pipeline::precise::reason::StretchReason;
use crate::pipeline::precise::scan::Scan;
use crate::pipeline::precise::scan::sampler::Sampler;
pub(crate) mod fill;
pub(crate) mod ledges;
pub(crate) mod surface;

use ledges::{CLOSELY, COARSELY, Look, Part, surrounded};
use surface::Surface;

/// Skin so far away from what is covered is surely none of it, in mm of links,
const NEAR_MM: f64 = 16.0;
/// if it is no island: least diagonal of the box around it, mm.
const LEAST_SKIN_MM: f64 = 150.0;
/// What would be filled further than this from there belongs to it.
const WITHIN: f64 = 0.5;
/// Larger pieces of skin than this may lie apart, mm².
const LARGEST_SCRAP_MM2: f64 = 4000.0;
/// What is slender and larger than fiducials and electrodes surrounds nothing, mm;
const LARGER_THAN_DISCS_MM: f64 = 40.0;
/// its ledge reaches so many links beside it.
const BESIDE: usize = 1;
/// Something foreign is beside a piece if it is near more nodes than this, of the square root of the
/// number within.
const BY_FOREIGN: f64 = 0.5;

/// What of the surface is no skin for sure.
#[derive(Debug)]
pub(crate) struct Covered {
    seen: [Seen; 2],
}

/// What one look at the surface has shown.
#[derive(Debug)]
struct Seen {
    leaf_mm: f64,
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

impl Fate {
    fn covered(part: &Part) -> Self {
        Self { reason: StretchReason::Covered, measured: part.ledge, limit: part.limit() }
    }
}

impl Covered {
    /// Searches the whole surface, whose crossings lie no further apart than a leaf of the mesh.
    /// Canals are closed at `canals`; what is `slender` surrounds nothing; `near_foreign` tells whether something foreign is close to a place.
    pub(crate) fn of(
        scan: &Scan<'_>,
        crossings: &[Crossing],
        canals: &[Vec3],
        slender: Option<&Slender>,
        near_foreign: impl Fn(Vec3) -> bool + Sync,
    ) -> Self {
        let searched = Searched { scan, crossings, canals, slender };
        let seen = |look, with_scraps| Seen::of(&searched, look, with_scraps);
        let (closely, coarsely) =
            rayon::join(|| seen(&CLOSELY, Some(&near_foreign)), || seen(&COARSELY, None));
        Self { seen: [closely, coarsely] }
    }

    /// Takes the crossings out that are no skin.
    pub(crate) fn take(&self, sampler: &Sampler, crossings: &mut Vec<Crossing>) -> Vec<Rejected> {
        let mut doubtful = Vec::new();
        if self.seen.iter().any(|seen| !seen.leaves.is_empty()) {
            let mut item = 0;
            crossings.retain(|c| {
                item += 1;
                sampler.ask_at(item);
                let fate = self.fate(c.place);
                doubtful.extend(fate.map(|Fate { reason, measured, limit }| Rejected {
                    place: c.place,
                    normal: c.normal,
                    axis: c.axis,
                    inner: sampler.index(c.place).rounded(),
                    reason,
                    measured,
                    limit,
                }));
                fate.is_none()
            });
        }
        doubtful
    }

    /// Whether a place is no skin.
    pub(crate) fn holds(&self, place: Vec3) -> bool {
        self.fate(place).is_some()
    }

    fn fate(&self, place: Vec3) -> Option<Fate> {
        self.seen.iter().find_map(|seen| seen.fate(place))
    }
}

/// The surface that is searched, and where canals are closed.
struct Searched<'a> {
    scan: &'a Scan<'a>,
    crossings: &'a [Crossing],
    canals: &'a [Vec3],
    slender: Option<&'a Slender>,
}

impl Seen {
    /// With `near_foreign` scraps are taken too.
    fn of(
        searched: &Searched<'_>,
        look: &Look,
        near_foreign: Option<&(impl Fn(Vec3) -> bool + Sync)>,
    ) -> Self {
        let Searched { scan, crossings, canals, slender } = *searched;
        let Scan { sampler, levels, .. } = scan;
        let mut surface = Surface::of(sampler.asked(), crossings, look.leaf_mm);
        sampler.ask();
        if let Some(slender) = slender {
            level(&mut surface, slender);
            sampler.ask();
        }
        let parts = surrounded(sampler, levels, &mut surface, look, canals);
        sampler.ask();
        let mut fates: Vec<Option<Fate>> = vec![None; surface.len()];
        for part in &parts {
            part.nodes.iter().for_each(|&node| fates[node] = Some(Fate::covered(part)));
        }
        // What goes with them has no rim of its own.
        if let Some(largest) = parts.iter().max_by_key(|part| part.nodes.len()) {
            let all: Vec<usize> = parts.iter().flat_map(|part| part.nodes.iter().copied()).collect();
            for node in surface.beyond(completed(&surface, &all), look.beyond) {
                fates[node].get_or_insert(Fate::covered(largest));
            }
        }
        let fate = Fate { reason: StretchReason::Touching, measured: 0.0, limit: BESIDE_MM.0 };
        for node in near_foreign.map_or_else(Vec::new, |near| scraps(&surface, near)) {
            fates[node].get_or_insert(fate);
        }
        let leaf = |(node, fate): (usize, Option<Fate>)| Some((surface.leaves[node], fate?));
        let leaves = fates.into_iter().enumerate().filter_map(leaf).collect();
        Self { leaf_mm: look.leaf_mm, leaves }
    }

    fn fate(&self, place: Vec3) -> Option<Fate> {
        let leaf = key(place, self.leaf_mm);
        self.leaves.binary_search_by_key(&leaf, |l| l.0).ok().map(|i| self.leaves[i].1)
    }
}

/// Takes the ledges at what is slender back: a cord around a face leaves the face as it is. Those at discs and at
/// the edges of thick things stay.
fn level(surface: &mut Surface, slender: &Slender) {
    let at_border = |node: usize| {
        surface.asked.ask_at(node);
        slender.at_border(surface.places[node], surface.normals[node].map(f64::from))
    };
    let stands: Vec<[bool; 2]> = (0..surface.len()).into_par_iter().panic_fuse().map(at_border).collect();
    let (_, mut pieces) = surface.parts(|node| stands[node][0], |_, _| true);
    pieces.retain(|nodes| {
        let high = nodes.iter().filter(|&&node| stands[node][1]).count();
        is_enough(high, nodes.len()) && surface.extent(nodes) > LARGER_THAN_DISCS_MM
    });
    surface.level_at(&surface.beyond(pieces.concat(), BESIDE));
}

/// The nodes of a part with what hangs together with it rather than with the skin further away, as the
/// nose and the lips of a mask do. What lies below in a hole of a mask is skin.
fn completed(surface: &Surface, part: &[usize]) -> Vec<usize> {
    let is_in = marked(surface, part);
    let (_, others) = surface.parts(|node| !is_in[node], |_, link| !link.is_ledge());
    let large = others.into_iter().filter(|nodes| surface.extent(nodes) >= LEAST_SKIN_MM);
    let mut is_far = marked(surface, &large.flatten().collect::<Vec<_>>());
    surface
        .beyond(part.to_vec(), (NEAR_MM / surface.leaf) as usize)
        .into_iter()
        .for_each(|node| is_far[node] = false);
    let from_part = fill::between(surface, &is_in, &is_far);
    (0..surface.len()).filter(|&node| from_part[node] > WITHIN).collect()
}

/// What is left apart between stretches that something foreign touches or covers: a head's skin hangs
/// together.
fn scraps(surface: &Surface, near_foreign: impl Fn(Vec3) -> bool + Sync) -> Vec<usize> {
    let (_, mut pieces) = surface.parts(|_| true, |_, _| true);
    let largest = pieces.iter().map(Vec::len).max();
    pieces.retain(|nodes| Some(nodes.len()) != largest && nodes.len() < surface.nodes_of(LARGEST_SCRAP_MM2));
    let left = |nodes: &Vec<usize>| {
        let near = nodes.iter().filter(|&&node| near_foreign(surface.places[node])).count();
        near as f64 > BY_FOREIGN * (nodes.len() as f64).sqrt()
    };
    pieces.into_par_iter().filter(left).flatten().collect()
}

/// Which nodes are among some.
fn marked(surface: &Surface, nodes: &[usize]) -> Vec<bool> {
    let mut marked = vec![false; surface.len()];
    nodes.iter().for_each(|&node| marked[node] = true);
    marked
}
