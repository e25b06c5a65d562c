//! What the result's quality is: the figures of [`Quality`], gathered.

use super::quality::{Missing, Quality, SideQuality, Verdict};
use super::sides::Side;
use crate::geometry::{Vec3, dot, norm};
use crate::observer::stop::Asked;
use crate::pipeline::precise::border::crossing::Crossing;
use crate::pipeline::precise::border::rejected::Rejected;
use crate::pipeline::precise::confidence::agreement::Agreement;
use crate::pipeline::precise::grid::cells::each_cell;
use crate::pipeline::precise::grid::index::Cell;
use crate::pipeline::precise::labels::head::Head;
use crate::pipeline::precise::labels::label::Label;
use crate::pipeline::precise::labels::patient::Patient;
use crate::pipeline::precise::reason::StretchReason;
use crate::pipeline::precise::scan::Scan;
use crate::pipeline::precise::scan::edge_spread::EdgeSpread;
use crate::pipeline::precise::scan::sampler::Sampler;

/// A staircase of cells has more face than the surface it follows: 1.5 times on average over all
/// directions.
const STAIRCASE: f64 = 1.5;

/// Areas of skin, in mm², by side of the head and fate.
#[derive(Debug, Default)]
pub(crate) struct Areas {
    accepted: [f64; 6],
    missing: [[f64; StretchReason::ALL.len()]; 6],
}

impl Areas {
    /// The skin of the head: that of the patient from the neck up.
    pub(crate) fn of(
        sampler: &Sampler,
        patient: &Patient,
        head: &Head,
        accepted: &[Crossing],
        rejected: &[Rejected],
    ) -> Self {
        let mut areas = Self::default();
        let side = |p: Vec3| (p[2] >= head.lower_end).then(|| Side::of(p, head.middle) as usize);
        for (i, c) in accepted.iter().enumerate() {
            sampler.ask_at(i);
            if let Some(side) = side(c.place) {
                areas.accepted[side] += share_of_skin(sampler, c.axis, c.normal);
            }
        }
        for (i, d) in rejected.iter().enumerate() {
            sampler.ask_at(i);
            // A canal is no skin, and a foreign body's border none of the patient's.
            if !matches!(d.reason, StretchReason::Foreign | StretchReason::Canal)
                && let Some(side) = side(d.place)
            {
                areas.missing[side][d.reason as usize] += share_of_skin(sampler, d.axis, d.normal);
            }
        }
        areas.add_contact(sampler, patient, side);
        areas
    }

    /// Where something lies on the skin no border is seen: the faces between the two.
    fn add_contact(&mut self, sampler: &Sampler, patient: &Patient, side: impl Fn(Vec3) -> Option<usize>) {
        let cells = &patient.survey.cells;
        let [nx, ny, nz] = cells.shape;
        let face = cells.edge * cells.edge / STAIRCASE;
        let foreign = |k: Label| matches!(k, Label::Attached | Label::Other);
        let labels = &patient.labels;
        each_cell(cells, |i, Cell([x, y, z])| {
            sampler.ask_at(i);
            if !patient.near_foreign[i] || labels[i] != Label::Patient {
                return;
            }
            let neighbours = [
                (x > 0, i.wrapping_sub(1)),
                (x + 1 < nx, i + 1),
                (y > 0, i.wrapping_sub(nx)),
                (y + 1 < ny, i + nx),
                (z > 0, i.wrapping_sub(nx * ny)),
                (z + 1 < nz, i + nx * ny),
            ];
            let faces = neighbours.iter().filter(|(is_in, j)| *is_in && foreign(labels[*j])).count();
            if faces > 0
                && let Some(side) = side(cells.centre(Cell([x, y, z])))
            {
                let area = faces as f64 * face;
                self.missing[side][StretchReason::Touching as usize] += area;
            }
        });
    }
}

/// What was measured on the result.
pub(crate) struct Measured<'a> {
    /// How wide the scan shows an edge.
    pub(crate) edge_spread: &'a EdgeSpread,
    /// Areas of skin by side and fate.
    pub(crate) areas: &'a Areas,
    /// How far at most a slice stands aside from its neighbours, mm.
    pub(crate) motion_mm: f64,
    /// Place and agreement of the points.
    pub(crate) points: &'a [(Vec3, Agreement)],
}

/// Everything that the verdict is made of; not judged yet.
pub(crate) fn quality(scan: &Scan<'_>, head: &Head, measured: &Measured<'_>) -> Quality {
    let Scan { sampler, levels, .. } = scan;
    let Measured { edge_spread, areas, motion_mm, points } = *measured;
    let asked = sampler.asked();
    let (mut all, mut of_sides): (Vec<f64>, [Vec<f64>; 6]) = (Vec::new(), Default::default());
    for (number, (place, agreement)) in points.iter().enumerate() {
        asked.ask_at(number);
        if agreement.is_known() {
            let offset = agreement.offset.abs();
            all.push(offset);
            of_sides[Side::of(*place, head.middle) as usize].push(offset);
        }
    }
    let (mean, p95) = spread(asked, all).unwrap_or((0.0, 0.0));
    let share = |accepted: f64, missing: f64| accepted / (accepted + missing);
    let missing_of = |side: usize| areas.missing[side].iter().sum::<f64>();
    let sides = Side::ALL.map(|side| {
        let i = side as usize;
        let spread = spread(asked, std::mem::take(&mut of_sides[i]));
        let in_view = areas.accepted[i] + missing_of(i);
        SideQuality {
            side,
            area_cm2: areas.accepted[i] / 100.0,
            coverage: (in_view > 0.0).then(|| share(areas.accepted[i], missing_of(i))),
            agreement_mean_mm: spread.map(|s| s.0),
            agreement_p95_mm: spread.map(|s| s.1),
        }
    });
    let missing = Side::ALL.into_iter().flat_map(|side| {
        let of_side = areas.missing[side as usize];
        StretchReason::ALL.into_iter().filter_map(move |reason| {
            let area_cm2 = of_side[reason as usize] / 100.0;
            (area_cm2 > 0.0).then_some(Missing { side, reason, area_cm2 })
        })
    });
    let accepted: f64 = areas.accepted.iter().sum();
    Quality {
        verdict: Verdict::Good,
        doubts: Vec::new(),
        coverage: share(accepted, (0..6).map(missing_of).sum()),
        missing: missing.collect(),
        agreement_mean_mm: mean,
        agreement_p95_mm: p95,
        sides: sides.into(),
        noise_hu: f64::from(levels.noise),
        clipped_air: levels.clipped.is_some(),
        edge_in_plane_mm: edge_spread.in_plane(),
        edge_across_mm: edge_spread.across(),
        slice_mm: sampler.gaps().into_iter().fold(0.0, f64::max),
        motion_mm,
        cut_above_cm2: head.cut_above_cm2,
        cut_below_cm2: head.cut_below_cm2,
        cut_at_side_cm2: head.cut_at_side_cm2,
        metal_cm3: head.metal_cm3,
        doubtful_slices: 0,
    }
}

/// The skin's area that a crossing stands for, mm²: that of a voxel's face, tilted, for the lines
/// that meet the skin most steeply; the others would count it again.
fn share_of_skin(sampler: &Sampler, axis: u8, normal: Vec3) -> f64 {
    let cosine = |a: usize| {
        let step = sampler.mean_step(a);
        dot(normal, step).abs() / norm(step)
    };
    let own = cosine(usize::from(axis));
    if (0..3).any(|a| cosine(a) > own) {
        return 0.0;
    }
    let face: f64 = (0..3).filter(|&a| a != usize::from(axis)).map(|a| norm(sampler.mean_step(a))).product();
    face / own
}

/// Mean and 95th percentile.
fn spread(asked: Asked<'_>, mut offsets: Vec<f64>) -> Option<(f64, f64)> {
    if offsets.is_empty() {
        return None;
    }
    let mut steps = 0;
    let mut ask = || {
        steps += 1;
        asked.ask_at(steps);
    };
    let mean = offsets.iter().inspect(|_| ask()).sum::<f64>() / offsets.len() as f64;
    let rank = offsets.len() * 95 / 100;
    let compared = |a: &f64, b: &f64| {
        ask();
        a.total_cmp(b)
    };
    let p95 = *offsets.select_nth_unstable_by(rank, compared).1;
    asked.free(offsets);
    Some((mean, p95))
}
