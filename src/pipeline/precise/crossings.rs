//! Every crossing of the skin with a grid line, in its true place.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::edge::{self, Profile};
use super::levels::Levels;
use super::outside::{Beyond, Outside};
use super::patient::{Cell, Patient};
use super::regions::{Regions, median};
use super::space::Space;
use super::stretches::StretchReason;
use super::width::Width;
use crate::geometry::{Axis, Plane, PlaneSet, Vec3, add, cross, dot, norm, normalised, scale, sub};

/// A pair of neighbouring voxels with the skin between them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    /// The voxel in the patient, `[z, y, x]`.
    pub(super) inner: [u16; 3],
    /// The axis of the line.
    pub(super) axis: u8,
    /// Whether the air lies toward the larger index.
    pub(super) ascending: bool,
    /// Rough place, LPS mm.
    pub(super) place: Vec3,
    /// Outward unit normal.
    pub(super) normal: Vec3,
    /// Level of the tissue just inside, HU.
    pub(super) tissue: f32,
    /// Level of the air just outside, HU.
    pub(super) air: f32,
    /// By how much the tissue's level falls further in, HU.
    pub(super) decline: f32,
}

/// A measured point of the skin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing {
    /// LPS mm.
    pub(super) place: Vec3,
    /// Outward unit normal.
    pub(super) normal: Vec3,
    /// The planes that it lies in and that cut the skin steeply there.
    pub(super) planes: PlaneSet,
    /// The axis of its line.
    pub(super) axis: u8,
    /// Whether it was seen, or interpolated between two slices.
    pub(super) between: bool,
    /// How many standard deviations of the edge there are from one voxel of the line to the next:
    /// the fewer, the better the line resolves the edge. Between slices: how far the contour moves
    /// from one to the next, in gaps.
    pub(super) coarseness: f64,
    /// Expected error along the normal, mm, from the edge alone.
    pub(super) error: f64,
    /// How far along the normal the crossing would move if the levels were those usual in the scan, mm.
    pub(super) level: f64,
}

/// Finds the candidates; and those borders of the patient that would be skin but for a doubt.
pub(super) fn candidates(
    space: &Space,
    levels: &Levels,
    patient: &Patient,
    outside: &Outside,
) -> (Vec<Candidate>, Vec<Doubtful>) {
    let [nz, ny, nx] = space.shape;
    let middle = levels.middle().ceil() as i16;
    let search = Search { space, levels, patient, outside };
    let found: Vec<Result<Candidate, Doubtful>> = (0..nz)
        .into_par_iter()
        .flat_map_iter(|z| {
            let mut found = Vec::new();
            for y in 0..ny {
                let row = &space.hu[space.offset([z, y, 0])..][..nx];
                for (x, pair) in row.windows(2).enumerate() {
                    if (pair[0] >= middle) != (pair[1] >= middle) {
                        found.extend(search.judge([z, y, x], 2, pair[0] >= middle));
                    }
                }
                for (axis, next) in [(1, [z, y + 1, 0]), (0, [z + 1, y, 0])] {
                    if next[1] >= ny || next[0] >= nz {
                        continue;
                    }
                    let other = &space.hu[space.offset(next)..][..nx];
                    for (x, (&a, &b)) in row.iter().zip(other).enumerate() {
                        if (a >= middle) != (b >= middle) {
                            found.extend(search.judge([z, y, x], axis, a >= middle));
                        }
                    }
                }
            }
            found
        })
        .collect();
    let (mut candidates, mut doubtful) = (Vec::with_capacity(found.len()), Vec::new());
    for one in found {
        match one {
            Ok(candidate) => candidates.push(candidate),
            Err(doubt) => doubtful.push(doubt),
        }
    }
    (candidates, doubtful)
}

/// A border of the patient that was not accepted as skin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Doubtful {
    /// Rough place, LPS mm.
    pub(super) place: Vec3,
    /// Outward unit normal.
    pub(super) normal: Vec3,
    /// The axis of its line.
    pub(super) axis: u8,
    /// The voxel in the patient, `[z, y, x]`.
    pub(super) inner: [u16; 3],
    /// Why.
    pub(super) reason: StretchReason,
    /// What was measured, in the reason's unit.
    pub(super) measured: f64,
    /// The limit for it.
    pub(super) limit: f64,
}

struct Search<'a> {
    space: &'a Space<'a>,
    levels: &'a Levels,
    patient: &'a Patient,
    outside: &'a Outside,
}

impl Search<'_> {
    /// The candidate between the voxel at `lower` and the next one along `axis`; `None` where it
    /// is no border of the patient to the outside at all.
    fn judge(&self, lower: [usize; 3], axis: usize, ascending: bool) -> Option<Result<Candidate, Doubtful>> {
        let mut upper = lower;
        upper[axis] += 1;
        let (inner, outer) = if ascending { (lower, upper) } else { (upper, lower) };
        let (a, b) = (self.space.voxel(inner), self.space.voxel(outer));
        let t = f64::from((a - self.levels.middle()) / (a - b));
        let mut index = inner.map(|i| i as f64);
        index[axis] += if ascending { t } else { -t };
        let place = self.space.lps(index);
        if !self.outside.is_near(place) {
            return None;
        }
        let normal = self.normal(place)?;
        let along = self.space.mean_step(axis);
        let cosine = dot(normal, along) / norm(along) * if ascending { 1.0 } else { -1.0 };
        if cosine < LEAST_COSINE {
            return None;
        }
        let inner_voxel = inner.map(|i| i as u16);
        let doubt = |reason, measured: f64, limit: f64| {
            let inner = inner_voxel;
            Some(Err(Doubtful { place, normal, axis: axis as u8, inner, reason, measured, limit }))
        };
        if self.patient.owns(self.space, place, normal) != Some(true) {
            return None;
        }
        match self.outside.beyond(place, normal) {
            Beyond::Outside => {}
            Beyond::Canal(mm) => return doubt(StretchReason::Canal, mm, self.outside.reach_mm()),
            Beyond::Inside => return None,
        }
        let (seen, padding) = (self.space.voxel(outer), self.levels.padding());
        if seen < padding {
            return doubt(StretchReason::FieldOfView, f64::from(seen), f64::from(padding));
        }
        if let Some(mm) = self.behind(place, normal) {
            return doubt(StretchReason::Foreign, mm, DEPTHS[3] * self.patient.survey.cells.edge);
        }
        if let Some(mm) = self.beside(place, normal) {
            return doubt(StretchReason::Touching, mm, BESIDE_MM.0);
        }
        let (tissue, air) = self.around(place, normal);
        let inner = inner_voxel;
        Some(Ok(Candidate { inner, axis: axis as u8, ascending, place, normal, tissue, air, decline: 0.0 }))
    }

    /// How far beside the border the nearest cell is that is not the patient's, if it is so near that
    /// it puts the border in doubt. Where something lies over it, as a holder does, the gap between
    /// them was seen, and only what reaches below it is beside it.
    fn beside(&self, p: Vec3, n: Vec3) -> Option<f64> {
        let (cells, kinds) = (&self.patient.survey.cells, &self.patient.kinds);
        let at = cells.at(p)?;
        if !self.patient.near_foreign[cells.offset(at)] {
            return None;
        }
        let from_here = |cell| {
            let d = sub(cells.centre(cell), p);
            (norm(d), dot(d, n))
        };
        let foreign: Vec<(f64, f64)> = cells
            .block(at, BESIDE_CELLS)
            .filter(|&cell| matches!(kinds[cells.offset(cell)], Cell::Attached | Cell::Other))
            .map(from_here)
            .collect();
        let covers = |&(distance, height): &(f64, f64)| {
            height > COVER_MM.0 && distance * distance - height * height < COVER_MM.1 * COVER_MM.1
        };
        let (reach, level) = if foreign.iter().any(covers) { COVERED_MM } else { BESIDE_MM };
        let beside = foreign.into_iter().filter(|f| f.0 <= reach && f.1 < level);
        beside.map(|f| f.0).min_by(f64::total_cmp)
    }

    /// How far behind the border the survey sees something that is not the patient; `None` if it
    /// sees the patient first.
    fn behind(&self, p: Vec3, n: Vec3) -> Option<f64> {
        let cells = &self.patient.survey.cells;
        for step in DEPTHS {
            if let Some(cell) = cells.at(add(p, scale(n, -step * cells.edge))) {
                match self.patient.kinds[cells.offset(cell)] {
                    Cell::Patient => return None,
                    Cell::Attached | Cell::Other => return Some(step * cells.edge),
                    Cell::Air => {}
                }
            }
        }
        Some(DEPTHS[3] * cells.edge)
    }

    /// Outward unit normal from the gradient of HU over about a voxel and a half.
    fn normal(&self, p: Vec3) -> Option<Vec3> {
        gradient(self.space, p).and_then(|g| normalised(scale(g, -1.0)))
    }

    /// Level of the tissue inside and of the air outside, as far as they show there.
    fn around(&self, p: Vec3, n: Vec3) -> (f32, f32) {
        let at = |d: f64| self.space.sample(add(p, scale(n, d)));
        let tissue = [-1.0, -1.4, -1.8].iter().filter_map(|&d| at(d)).fold(f32::MIN, f32::max);
        let air = [1.2, 1.8, 2.4].iter().filter_map(|&d| at(d)).fold(f32::MAX, f32::min);
        let cells = &self.patient.survey.cells;
        if cells.at(p).is_some_and(|cell| self.patient.near_foreign[cells.offset(cell)]) {
            return (tissue, gap(self.levels.air, tissue, air));
        }
        (tissue, air)
    }
}

/// The level of the air that puts the half-way place at the skin, where `seen` is the least between
/// the skin and something foreign next to it: both borders' blur meets in the middle of the gap,
/// and the far one's reaches the skin itself, twice as far away, a little too.
fn gap(air: f32, tissue: f32, seen: f32) -> f32 {
    let share = f64::from((seen - air) / (tissue - air)).clamp(0.0, 1.0);
    if share < 0.01 {
        return air;
    }
    let half_gap = -edge::probit(0.5 * share);
    air + (2.0 * upper_tail(2.0 * half_gap)) as f32 * (tissue - air)
}

/// What touches the patient puts the skin so near beside it in doubt, and what is higher against the
/// skin than this does not touch it there, mm.
const BESIDE_MM: (f64, f64) = (2.5, 1.0);
/// The same where something covers the skin, mm.
const COVERED_MM: (f64, f64) = (1.5, -0.5);
/// What is higher above the skin than this, and no further aside, covers it, mm.
const COVER_MM: (f64, f64) = (1.0, 1.0);
/// The furthest of these in cells of 1 mm, the smallest.
const BESIDE_CELLS: usize = 3;
/// How far behind the border the survey is asked, in cells.
const DEPTHS: [f64; 4] = [0.6, 1.1, 1.6, 2.1];
/// A line that meets the skin flatter than this is left to the others.
const LEAST_COSINE: f64 = 0.25;

/// Gradient of HU at a place, per mm along x, y, z.
fn gradient(space: &Space, p: Vec3) -> Option<Vec3> {
    let mut g = [0.0; 3];
    let reach = GRADIENT_MM;
    for a in 0..3 {
        let (mut low, mut high) = (p, p);
        low[a] -= reach;
        high[a] += reach;
        let (low, high) = match (space.sample(low), space.sample(high)) {
            (Some(l), Some(h)) => (f64::from(l) / 2.0, f64::from(h) / 2.0),
            (Some(l), None) => (f64::from(l), f64::from(space.sample(p)?)),
            (None, Some(h)) => (f64::from(space.sample(p)?), f64::from(h)),
            (None, None) => return None,
        };
        g[a] = (high - low) / reach;
    }
    Some(g)
}

const GRADIENT_MM: f64 = 0.8;

/// Measures each candidate.
pub(super) fn measure(
    space: &Space,
    levels: &Levels,
    width: &Width,
    regions: &Regions,
    candidates: &[Candidate],
) -> Vec<Crossing> {
    let steep = Steep::new(space);
    let usual_air = median((0..candidates.len()).map(|i| regions.levels(i).1));
    let usual_decline = median(candidates.iter().map(|c| c.decline));
    candidates
        .par_iter()
        .enumerate()
        .filter_map(|(i, c)| {
            let (tissue, air) = regions.levels(i);
            let contrast = f64::from(tissue - air);
            let step = space.mean_step(usize::from(c.axis));
            let across = dot(c.normal, step).abs();
            let sigma = width.along(c.normal, space.slice_normal());
            let profile = Profile {
                shares: profile(space, c).map(|v| f64::from(v - air) / contrast),
                slope: across / sigma,
                noise: f64::from(levels.noise) / contrast,
            };
            let edge = edge::fit(&profile);
            if !(-1.5..=2.5).contains(&edge.place) {
                return None;
            }
            let mut index = c.inner.map(f64::from);
            let axis = usize::from(c.axis);
            index[axis] += if c.ascending { edge.place } else { -edge.place };
            // Beyond the first and the last voxel nothing was measured.
            if !(0.0..=(space.shape[axis] - 1) as f64).contains(&index[axis]) {
                return None;
            }
            Some(Crossing {
                place: space.lps(index),
                normal: c.normal,
                planes: steep.planes(c.axis, c.normal),
                axis: c.axis,
                between: false,
                coarseness: across / sigma,
                error: edge.deviation * across,
                level: sigma * TAU.sqrt() * f64::from((air - usual_air).hypot(c.decline - usual_decline))
                    / contrast,
            })
        })
        .collect()
}

/// Reads the tissue's level again, now that the edge and its width are known: close behind the
/// edge, before the next layer begins, with what the air lends to it taken off.
pub(super) fn refine_levels(space: &Space, width: &Width, regions: &Regions, candidates: &mut [Candidate]) {
    candidates.par_iter_mut().enumerate().for_each(|(i, c)| {
        let (_, air) = regions.levels(i);
        let sigma = width.seen_along(space, c.normal);
        // The tissue's share of what is seen at a depth is known; the rest is air.
        let level = |depth: f64| {
            let lent = upper_tail(depth / sigma);
            let seen = f64::from(space.sample(add(c.place, scale(c.normal, -depth)))?);
            Some((seen - lent * f64::from(air)) / (1.0 - lent))
        };
        let depths = PLATEAU.map(|(deviations, most)| f64::min(deviations * sigma, most));
        let [Some(first), Some(second)] = depths.map(level) else { return };
        let mut tissue = f64::midpoint(first, second);
        let further = level(depths[1] + FURTHER_MM);
        c.decline = further.map_or(0.0, |further| (tissue - further) as f32);
        // As far as what lies below the skin shows already, it is taken off by what it shows further in.
        let (near, far) = (f64::midpoint(depths[0], depths[1]), depths[1] + FURTHER_MM);
        if let Some(decline) = further.map(|further| tissue - further).filter(|d| DECLINE.contains(d)) {
            let below = |depth: f64| upper_tail((SKIN_MM - depth) / sigma);
            tissue += decline * below(near) / (below(far) - below(near));
        }
        c.tissue = tissue as f32;
    });
}

/// How far behind the edge the tissue's level is read, in standard deviations of the edge, but no
/// further than so many mm: there the fat below the skin begins to show.
const PLATEAU: [(f64, f64); 2] = [(1.4, 0.7), (1.9, 0.85)];
/// So much further in it is read once more, mm.
const FURTHER_MM: f64 = 0.5;
/// Thickness of the skin, mm: that of face and scalp is 1.5 to 2.5.
const SKIN_MM: f64 = 1.8;
/// By how much the level may fall to there for fat to be the cause, HU.
const DECLINE: std::ops::Range<f64> = -60.0..120.0;

/// The share of a blurred step that lies beyond a number of standard deviations (Zelen and
/// Severo's approximation, to 1e-5).
fn upper_tail(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.33267 * x);
    (-0.5 * x * x).exp() * 0.398_942_3 * t * (0.436_183_6 + t * (-0.120_167_6 + t * 0.937_298))
}

/// Six voxels along the line, from the tissue to the air; the candidate's two in the middle.
pub(super) fn profile(space: &Space, c: &Candidate) -> [f32; 6] {
    let axis = usize::from(c.axis);
    let index = c.inner.map(usize::from);
    let last = space.shape[axis] - 1;
    std::array::from_fn(|i| {
        let mut at = index;
        at[axis] = if c.ascending {
            (index[axis] + i).saturating_sub(2).min(last)
        } else {
            (index[axis] + 2).saturating_sub(i).min(last)
        };
        space.voxel(at)
    })
}

/// Which planes cut the skin steeply.
struct Steep {
    normals: [Vec3; 3],
}

/// Least sine of the angle between skin and plane.
const LEAST_SINE: f64 = 0.5;

impl Steep {
    fn new(space: &Space) -> Self {
        let [z, y, x] = [Axis::Z, Axis::Y, Axis::X].map(|a| space.mean_step(a as usize));
        let unit = |a, b| normalised(cross(a, b)).unwrap_or([0.0, 0.0, 1.0]);
        Self { normals: [unit(x, y), unit(y, z), unit(x, z)] }
    }

    fn planes(&self, axis: u8, n: Vec3) -> PlaneSet {
        let both = match axis {
            2 => [Plane::Axial, Plane::Coronal],
            1 => [Plane::Axial, Plane::Sagittal],
            _ => [Plane::Sagittal, Plane::Coronal],
        };
        let mut set = PlaneSet::EMPTY;
        for plane in both {
            let cosine = dot(self.normals[plane.index()], n);
            if 1.0 - cosine * cosine >= LEAST_SINE * LEAST_SINE {
                set = set.union(plane.into());
            }
        }
        set
    }
}
