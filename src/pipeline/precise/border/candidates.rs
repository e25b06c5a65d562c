//! Where the skin crosses a grid line, roughly: every pair of neighbouring voxels with the patient on one
//! side and air outside on the other, unless a rule says why it is no skin.

use rayon::prelude::*;

use super::candidate::Candidate;
use super::edge_fit;
use super::local_levels::AtSkin;
use super::rejected::Rejected;
use super::sighting::{Pair, Rule, Sighting};
use super::split::joined;
use crate::geometry::Vec3;
use crate::pipeline::precise::grid::bit_rows::{BitRows, WORD, ones, steps};
use crate::pipeline::precise::grid::index::Voxel;
use crate::pipeline::precise::labels::Labels;
use crate::pipeline::precise::labels::patient::Patient;
use crate::pipeline::precise::scan::Scan;

/// Finds the candidates; and those borders of the patient that a rule rejects. The first rule that says why
/// decides.
pub(crate) fn find(scan: &Scan<'_>, labels: &Labels, rules: &[Rule]) -> (Vec<Candidate>, Vec<Rejected>) {
    let Scan { sampler, levels, .. } = scan;
    let [nz, ny, nx] = sampler.shape;
    let middle = levels.middle().ceil() as i16;
    let dense = BitRows::of(sampler.asked(), nx, sampler.hu, |&v| v >= middle);
    let look = |line| judge(scan, labels, rules, line);
    let found: Vec<(Vec<Candidate>, Vec<Rejected>)> = (0..nz)
        .into_par_iter()
        .panic_fuse()
        .map(|z| {
            let (mut candidates, mut rejected) = (Vec::new(), Vec::new());
            let mut judge = |lower, axis, ascending| match look(Pair { lower: Voxel(lower), axis, ascending })
            {
                Some(Ok(candidate)) => candidates.push(candidate),
                Some(Err(one)) => rejected.push(one),
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
            (candidates, rejected)
        })
        .collect();
    joined(sampler.asked(), found)
}

/// What the rules make of a pair; `None` where it is no border of the patient to the outside at all.
fn judge(
    scan: &Scan<'_>,
    labels: &Labels,
    rules: &[Rule],
    pair: Pair,
) -> Option<Result<Candidate, Rejected>> {
    let sighting = Sighting::of(scan, labels, pair)?;
    if let Some(refusal) = rules.iter().find_map(|rule| rule(scan, labels, &sighting)) {
        return Some(Err(sighting.rejected(refusal)));
    }
    let Sighting { pair, inner, place, normal, .. } = sighting;
    let AtSkin { tissue, air } = around(scan, &labels.patient, place, normal);
    Some(Ok(Candidate {
        inner: inner.short(),
        axis: pair.axis as u8,
        ascending: pair.ascending,
        place,
        normal,
        tissue,
        air,
        decline: 0.0,
    }))
}

/// Level of the tissue inside and of the air outside, as far as they show there.
fn around(scan: &Scan<'_>, patient: &Patient, p: Vec3, n: Vec3) -> AtSkin {
    let Scan { sampler, levels, .. } = scan;
    let line = sampler.line(p, n);
    let at = |d: f64| line.sample(d);
    let tissue = [-1.0, -1.4, -1.8].iter().filter_map(|&d| at(d)).reduce(f32::max);
    let air = [1.2, 1.8, 2.4].iter().filter_map(|&d| at(d)).reduce(f32::min);
    // At the ends of the scan nothing is seen of one of them.
    let (tissue, air) = (tissue.unwrap_or(levels.tissue), air.unwrap_or(levels.air));
    if patient.is_near_foreign(p) {
        return AtSkin { tissue, air: gap(levels.air, tissue, air) };
    }
    AtSkin { tissue, air }
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
