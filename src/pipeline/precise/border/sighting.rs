//! The border of the patient as the first look sees it, which the rules judge.

use super::rejected::Rejected;
use crate::geometry::{Vec3, add, dot, norm, normalised, scale};
use crate::pipeline::precise::grid::index::Voxel;
use crate::pipeline::precise::labels::Labels;
use crate::pipeline::precise::labels::label::Label;
use crate::pipeline::precise::labels::outside::Beyond;
use crate::pipeline::precise::labels::patient::{CLEAR_MM, Patient};
use crate::pipeline::precise::reason::StretchReason;
use crate::pipeline::precise::scan::Scan;
use crate::pipeline::precise::scan::sampler::Sampler;

/// Two neighbouring voxels with the half-way level between them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pair {
    /// The one with the smaller index.
    pub(crate) lower: Voxel,
    /// The axis that leads to the other.
    pub(crate) axis: usize,
    /// Whether the air lies toward the larger index.
    pub(crate) ascending: bool,
}

/// A place where the patient may end.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sighting {
    /// The voxels on both sides.
    pub(crate) pair: Pair,
    /// The one in the patient.
    pub(crate) inner: Voxel,
    /// Rough place, LPS mm.
    pub(crate) place: Vec3,
    /// Outward unit normal.
    pub(crate) normal: Vec3,
    /// How far behind the border the patient's clear tissue begins, mm.
    pub(crate) clear_mm: f64,
    /// What lies on the far side.
    pub(crate) beyond: Beyond,
    /// What the survey shows first behind the border, and how far behind it, mm; air if nothing at all.
    pub(crate) behind: (Label, f64),
    /// How many voxels from the border the field of view ends, if it is so near that nobody can tell the
    /// two apart.
    pub(crate) field_ends: Option<usize>,
}

/// Why a sighting is no skin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Refusal {
    /// The reason.
    pub(crate) reason: StretchReason,
    /// What was measured, in the reason's unit.
    pub(crate) measured: f64,
    /// The limit for it.
    pub(crate) limit: f64,
}

/// A rule that judges a sighting by itself: why it is no skin, or `None`.
pub(crate) type Rule = fn(&Scan<'_>, &Labels, &Sighting) -> Option<Refusal>;

/// A line that meets the skin flatter than this is left to the others, cosine.
const LEAST_COSINE: f64 = 0.25;
/// How far behind the border the survey is asked, in cells.
const DEPTHS: [f64; 4] = [0.6, 1.1, 1.6, 2.1];
/// The furthest of these.
pub(crate) const DEEPEST_CELLS: f64 = DEPTHS[3];

impl Sighting {
    /// What the first look shows; `None` where it is no border of the patient to the outside at all.
    pub(crate) fn of(scan: &Scan<'_>, labels: &Labels, pair: Pair) -> Option<Self> {
        let Scan { sampler, levels, .. } = scan;
        let Pair { lower, axis, ascending } = pair;
        let mut upper = lower;
        upper[axis] += 1;
        let (inner, outer) = if ascending { (lower, upper) } else { (upper, lower) };
        let (a, b) = (sampler.voxel(inner), sampler.voxel(outer));
        let t = f64::from((a - levels.middle()) / (a - b));
        let mut index = inner.centre();
        index[axis] += if ascending { t } else { -t };
        let place = sampler.lps(index);
        if !labels.outside.is_near(place) {
            return None;
        }
        let normal = outward(sampler, place)?;
        let along = sampler.mean_step(axis);
        let cosine = dot(normal, along) / norm(along) * if ascending { 1.0 } else { -1.0 };
        if cosine < LEAST_COSINE {
            return None;
        }
        let (clear_mm, true) = labels.patient.clear_tissue(scan, place, normal)? else {
            return None;
        };
        let field_ends = field_ends(scan, inner, outer);
        let beyond = labels.outside.beyond(place, normal);
        match beyond {
            Beyond::Inside => return None,
            Beyond::Cut if field_ends.is_none() => return None,
            // What a thick slice blurs shows in the slices beside it.
            Beyond::Cut | Beyond::Outside
                if clear_mm > CLEAR_MM && clear_mm <= slice_along(sampler, inner, normal) =>
            {
                return None;
            }
            _ => {}
        }
        let behind = behind(&labels.patient, place, normal);
        Some(Self { pair, inner, place, normal, clear_mm, beyond, behind, field_ends })
    }

    /// The sighting as a place that is not accepted.
    pub(crate) fn rejected(&self, refusal: Refusal) -> Rejected {
        let Refusal { reason, measured, limit } = refusal;
        Rejected {
            place: self.place,
            normal: self.normal,
            axis: self.pair.axis as u8,
            inner: self.inner.short(),
            reason,
            measured,
            limit,
        }
    }
}

/// How many voxels from the border the field of view ends.
fn field_ends(scan: &Scan<'_>, inner: Voxel, outer: Voxel) -> Option<usize> {
    if scan.sampler.voxel(outer) < scan.levels.padding() {
        return Some(0);
    }
    scan.field_of_view.distance(inner)
}

/// What the survey shows first behind a border, and how far behind it, mm.
fn behind(patient: &Patient, p: Vec3, n: Vec3) -> (Label, f64) {
    let cells = &patient.survey.cells;
    let label = |step: f64| {
        let cell = cells.at(add(p, scale(n, -step * cells.edge)))?;
        Some((patient.labels[cells.offset(cell)], step * cells.edge))
    };
    let seen = DEPTHS.into_iter().filter_map(label).find(|(label, _)| *label != Label::Air);
    seen.unwrap_or((Label::Air, DEEPEST_CELLS * cells.edge))
}

/// How thick a slice is at a voxel along the normal, mm.
fn slice_along(sampler: &Sampler, at: Voxel, n: Vec3) -> f64 {
    let axis = sampler.slice_axis();
    dot(sampler.step_at(axis, at[axis]), n).abs()
}

/// Outward unit normal from the gradient of HU over about a voxel and a half.
fn outward(sampler: &Sampler, p: Vec3) -> Option<Vec3> {
    gradient(sampler, p).and_then(|g| normalised(scale(g, -1.0)))
}

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

/// How far the gradient looks to each side, mm.
const GRADIENT_MM: f64 = 0.8;
