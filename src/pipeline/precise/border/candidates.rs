//! Where the skin crosses a grid line, roughly, and which borders of the patient are no skin.

use rayon::prelude::*;

use super::candidate::Candidate;
use super::edge_fit;
use super::rejected::Rejected;
use super::split::joined;
use crate::geometry::{Vec3, add, dot, norm, normalised, scale, sub};
use crate::pipeline::precise::grid::bit_rows::{BitRows, WORD, ones, steps};
use crate::pipeline::precise::labels::label::Label;
use crate::pipeline::precise::labels::outside::{Beyond, Outside};
use crate::pipeline::precise::labels::patient::{CLEAR_MM, Patient};
use crate::pipeline::precise::reason::StretchReason;
use crate::pipeline::precise::scan::field_of_view::{self, FieldOfView};
use crate::pipeline::precise::scan::levels::Levels;
use crate::pipeline::precise::scan::sampler::Sampler;

/// Finds the candidates; and those borders of the patient that would be skin but for a doubt.
pub(crate) fn find(
    sampler: &Sampler,
    levels: &Levels,
    field: &FieldOfView,
    patient: &Patient,
    outside: &Outside,
) -> (Vec<Candidate>, Vec<Rejected>) {
    let [nz, ny, nx] = sampler.shape;
    let middle = levels.middle().ceil() as i16;
    let dense = BitRows::of(sampler.asked(), nx, sampler.hu, |&v| v >= middle);
    let search = Search { sampler, levels, field, patient, outside };
    let found: Vec<(Vec<Candidate>, Vec<Rejected>)> = (0..nz)
        .into_par_iter()
        .panic_fuse()
        .map(|z| {
            let (mut candidates, mut doubtful) = (Vec::new(), Vec::new());
            let mut judge = |at, axis, ascending| match search.judge(at, axis, ascending) {
                Some(Ok(candidate)) => candidates.push(candidate),
                Some(Err(doubt)) => doubtful.push(doubt),
                None => {}
            };
            for y in 0..ny {
                sampler.ask();
                let row = dense.row(z * ny + y);
                let is_dense = |x: usize| row[x / WORD] >> (x % WORD) & 1 == 1;
                steps(row, nx).for_each(|x| judge([z, y, x], 2, is_dense(x)));
                for (axis, next) in [(1, [z, y + 1]), (0, [z + 1, y])] {
                    if next[0] < nz && next[1] < ny {
                        let across = row.iter().zip(dense.row(next[0] * ny + next[1])).map(|(a, b)| a ^ b);
                        ones(across).for_each(|x| judge([z, y, x], axis, is_dense(x)));
                    }
                }
            }
            (candidates, doubtful)
        })
        .collect();
    joined(found)
}

struct Search<'a> {
    sampler: &'a Sampler<'a>,
    levels: &'a Levels,
    field: &'a FieldOfView,
    patient: &'a Patient,
    outside: &'a Outside,
}

impl Search<'_> {
    /// The candidate between the voxel at `lower` and the next one along `axis`; `None` where it
    /// is no border of the patient to the outside at all.
    fn judge(&self, lower: [usize; 3], axis: usize, ascending: bool) -> Option<Result<Candidate, Rejected>> {
        let mut upper = lower;
        upper[axis] += 1;
        let (inner, outer) = if ascending { (lower, upper) } else { (upper, lower) };
        let (a, b) = (self.sampler.voxel(inner), self.sampler.voxel(outer));
        let t = f64::from((a - self.levels.middle()) / (a - b));
        let mut index = inner.map(|i| i as f64);
        index[axis] += if ascending { t } else { -t };
        let place = self.sampler.lps(index);
        if !self.outside.is_near(place) {
            return None;
        }
        let normal = self.normal(place)?;
        let along = self.sampler.mean_step(axis);
        let cosine = dot(normal, along) / norm(along) * if ascending { 1.0 } else { -1.0 };
        if cosine < LEAST_COSINE {
            return None;
        }
        let inner_voxel = inner.map(|i| i as u16);
        let doubt = |reason, measured: f64, limit: f64| {
            let inner = inner_voxel;
            Some(Err(Rejected { place, normal, axis: axis as u8, inner, reason, measured, limit }))
        };
        let (clear_mm, true) = self.patient.clear_tissue(self.sampler, self.levels, place, normal)? else {
            return None;
        };
        let ends = self.field_ends(inner, outer);
        match self.outside.beyond(place, normal) {
            Beyond::Outside => {}
            Beyond::Cut if ends.is_some() => {}
            Beyond::Canal(mm) => return doubt(StretchReason::Canal, mm, self.outside.reach_mm()),
            Beyond::Inside | Beyond::Cut => return None,
        }
        // What a thick slice blurs shows in the slices beside it.
        if clear_mm > CLEAR_MM && clear_mm <= self.blur(inner, normal) {
            return None;
        }
        // First, for a couch wider than the field of view is not the patient's missing skin.
        match self.behind(place, normal) {
            (Label::Patient, _) => {}
            // A layer that is no clear tissue, but nothing else either.
            (Label::Air, _) if clear_mm > CLEAR_MM && self.is_patient(place, normal, clear_mm) => {
                return doubt(StretchReason::Unresolved, clear_mm, CLEAR_MM);
            }
            (_, mm) => {
                return doubt(StretchReason::Foreign, mm, DEPTHS[3] * self.patient.survey.cells.edge);
            }
        }
        if let Some(voxels) = ends {
            let pixel = self.sampler.largest_pixel();
            return doubt(
                StretchReason::FieldOfView,
                voxels as f64 * pixel,
                field_of_view::RIM as f64 * pixel,
            );
        }
        if let Some(mm) = self.beside(place, normal) {
            return doubt(StretchReason::Touching, mm, BESIDE_MM.0);
        }
        if clear_mm > CLEAR_MM {
            return doubt(StretchReason::Unresolved, clear_mm, CLEAR_MM);
        }
        let (tissue, air) = self.around(place, normal);
        let inner = inner_voxel;
        Some(Ok(Candidate { inner, axis: axis as u8, ascending, place, normal, tissue, air, decline: 0.0 }))
    }

    /// How many voxels from the border the field of view ends, if it is so near that nobody can tell the
    /// two apart.
    fn field_ends(&self, inner: [usize; 3], outer: [usize; 3]) -> Option<usize> {
        if self.sampler.voxel(outer) < self.levels.padding() {
            return Some(0);
        }
        self.field.distance(inner)
    }

    /// How far beside the border the nearest cell is that is not the patient's, if it is so near that
    /// it puts the border in doubt. Where something lies over it, as a holder does, the gap between
    /// them was seen, and only what reaches below it is beside it.
    fn beside(&self, p: Vec3, n: Vec3) -> Option<f64> {
        let (cells, labels) = (&self.patient.survey.cells, &self.patient.labels);
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
            .filter(|&cell| matches!(labels[cells.offset(cell)], Label::Attached | Label::Other))
            .map(from_here)
            .collect();
        let covers = |&(distance, height): &(f64, f64)| {
            height > COVER_MM.0 && distance * distance - height * height < COVER_MM.1 * COVER_MM.1
        };
        let (reach, level) = if foreign.iter().any(covers) { COVERED_MM } else { BESIDE_MM };
        let beside = foreign.into_iter().filter(|f| f.0 <= reach && f.1 < level);
        beside.map(|f| f.0).min_by(f64::total_cmp)
    }

    /// What the survey sees first behind the border, and how far behind it, mm; air if nothing at all.
    fn behind(&self, p: Vec3, n: Vec3) -> (Label, f64) {
        let cells = &self.patient.survey.cells;
        let kind = |step: f64| {
            let cell = cells.at(add(p, scale(n, -step * cells.edge)))?;
            Some((self.patient.labels[cells.offset(cell)], step * cells.edge))
        };
        let seen = DEPTHS.into_iter().filter_map(kind).find(|(kind, _)| *kind != Label::Air);
        seen.unwrap_or((Label::Air, DEPTHS[3] * cells.edge))
    }

    /// How thick a slice is at a voxel along the normal, mm.
    fn blur(&self, at: [usize; 3], n: Vec3) -> f64 {
        let axis = self.sampler.slice_axis();
        dot(self.sampler.step_at(axis, at[axis]), n).abs()
    }

    /// Whether the survey sees the patient so far behind the border, or a cell further.
    fn is_patient(&self, p: Vec3, n: Vec3, mm: f64) -> bool {
        let cells = &self.patient.survey.cells;
        let depths = [mm, mm + cells.edge].into_iter();
        let mut labels = depths.filter_map(|d| cells.at(add(p, scale(n, -d)))).map(|cell| cells.offset(cell));
        labels.any(|cell| self.patient.labels[cell] == Label::Patient)
    }

    /// Outward unit normal from the gradient of HU over about a voxel and a half.
    fn normal(&self, p: Vec3) -> Option<Vec3> {
        gradient(self.sampler, p).and_then(|g| normalised(scale(g, -1.0)))
    }

    /// Level of the tissue inside and of the air outside, as far as they show there.
    fn around(&self, p: Vec3, n: Vec3) -> (f32, f32) {
        let line = self.sampler.line(p, n);
        let at = |d: f64| line.sample(d);
        let tissue = [-1.0, -1.4, -1.8].iter().filter_map(|&d| at(d)).reduce(f32::max);
        let air = [1.2, 1.8, 2.4].iter().filter_map(|&d| at(d)).reduce(f32::min);
        // At the ends of the scan nothing is seen of one of them.
        let (tissue, air) = (tissue.unwrap_or(self.levels.tissue), air.unwrap_or(self.levels.air));
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
    let half_gap = -edge_fit::probit(0.5 * share);
    air + (2.0 * edge_fit::upper_tail(2.0 * half_gap)) as f32 * (tissue - air)
}

/// What touches the patient puts the skin so near beside it in doubt, and what is higher against the
/// skin than this does not touch it there, mm.
pub(crate) const BESIDE_MM: (f64, f64) = (2.5, 1.0);
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
fn gradient(sampler: &Sampler, p: Vec3) -> Option<Vec3> {
    let mut g = [0.0; 3];
    let reach = GRADIENT_MM;
    for a in 0..3 {
        let mut along = [0.0; 3];
        along[a] = 1.0;
        let line = sampler.line(p, along);
        let (low, high) = match (line.sample(-reach), line.sample(reach)) {
            (Some(l), Some(h)) => (f64::from(l) / 2.0, f64::from(h) / 2.0),
            (Some(l), None) => (f64::from(l), f64::from(line.sample(0.0)?)),
            (None, Some(h)) => (f64::from(line.sample(0.0)?), f64::from(h)),
            (None, None) => return None,
        };
        g[a] = (high - low) / reach;
    }
    Some(g)
}

const GRADIENT_MM: f64 = 0.8;
