//! The report on every slice: how much of its contour is accepted, and which stretches of it are
//! not. A bad spot costs its own stretch, not the slice.

use std::collections::{BTreeMap, HashMap};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::geometry::{Plane, Vec3, dot, norm, sub};
use crate::pipeline::precise::border::crossing::Crossing;
use crate::pipeline::precise::border::rejected::Rejected;
use crate::pipeline::precise::reason::StretchReason;
use crate::pipeline::precise::scan::sampler::Sampler;
use crate::pipeline::slices;

/// A stretch of a slice's contour that was not accepted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Stretch {
    /// Why.
    pub reason: StretchReason,
    /// Its length along the contour, mm.
    pub length_mm: f64,
    /// What was measured where it was measured worst: mm to the other body (0 for a patch left apart
    /// between such stretches), to the canal or to the end of the field of view; how far off the skin
    /// could be, mm (`unresolved`); the share of its rim that is a ledge (`covered`).
    pub measured: f64,
    /// The limit it was held against, in the same unit.
    pub limit: f64,
}

/// What became of a slice's contour.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct SliceContour {
    /// The plane.
    pub plane: Plane,
    /// Index within the plane.
    pub index: usize,
    /// Accepted contour, mm.
    pub accepted_mm: f64,
    /// The rest.
    pub rejected: Vec<Stretch>,
}

/// Points of a contour further apart than so many voxels do not hang together.
const APART: f64 = 2.5;

/// A row for every slice that shows any contour: axial, then sagittal, then coronal, by index.
pub(crate) fn rows(sampler: &Sampler, measured: &[Crossing], doubtful: &[Rejected]) -> Vec<SliceContour> {
    let mut accepted: BTreeMap<(Plane, u16), f64> = BTreeMap::new();
    let mut rejected: BTreeMap<(Plane, u16), Vec<&Rejected>> = BTreeMap::new();
    for (i, c) in measured.iter().enumerate() {
        sampler.ask_at(i);
        let index = sampler.index(c.place);
        for plane in planes_of(c.axis) {
            *accepted.entry((plane, index[across(plane)].round() as u16)).or_default() +=
                length(sampler, plane, c.normal);
        }
    }
    for (i, d) in doubtful.iter().enumerate() {
        sampler.ask_at(i);
        for plane in planes_of(d.axis) {
            let key = (plane, d.inner[across(plane)]);
            accepted.entry(key).or_default();
            rejected.entry(key).or_default().push(d);
        }
    }
    accepted
        .into_par_iter()
        .panic_fuse()
        .map(|((plane, index), accepted_mm)| SliceContour {
            plane,
            index: usize::from(index),
            accepted_mm,
            rejected: rejected.get(&(plane, index)).map_or_else(Vec::new, |d| stretches(sampler, plane, d)),
        })
        .collect()
}

/// The array axis along which a plane's slices are counted.
pub(crate) fn across(plane: Plane) -> usize {
    slices::axis(plane) as usize
}

/// The two planes that a line along an axis lies in.
fn planes_of(axis: u8) -> impl Iterator<Item = Plane> {
    Plane::ALL.into_iter().filter(move |&p| across(p) != usize::from(axis))
}

/// The length of contour that one crossing stands for: in a slice, a contour of unit length with
/// the normal n crosses |nₐ| / sₐ + |n_b| / s_b lines.
fn length(sampler: &Sampler, plane: Plane, normal: Vec3) -> f64 {
    let in_plane = (0..3).filter(|&a| a != across(plane)).map(|a| {
        let step = sampler.mean_step(a);
        let spacing = norm(step);
        (dot(normal, step).abs() / spacing, spacing)
    });
    let (mut square, mut lines) = (0.0, 0.0);
    for (n, spacing) in in_plane {
        square += n * n;
        lines += n / spacing;
    }
    if lines > 0.0 { f64::sqrt(square) / lines } else { 0.0 }
}

/// Chains the rejected crossings of one slice.
fn stretches(sampler: &Sampler, plane: Plane, rejected: &[&Rejected]) -> Vec<Stretch> {
    let reach = APART
        * (0..3).filter(|&a| a != across(plane)).map(|a| norm(sampler.mean_step(a))).fold(0.0, f64::max);
    // Only what lies in a cell of that edge or in one beside it can be near enough.
    let cell = |i: usize| rejected[i].place.map(|v| (v / reach).floor() as i64);
    let mut cells: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    for i in 0..rejected.len() {
        cells.entry(cell(i)).or_default().push(i);
    }
    let mut done = vec![false; rejected.len()];
    let mut found = Vec::new();
    for first in 0..rejected.len() {
        if done[first] {
            continue;
        }
        done[first] = true;
        let reason = rejected[first].reason;
        let mut chain = vec![first];
        let mut next = 0;
        while next < chain.len() {
            sampler.ask_at(next);
            let (here, [x, y, z]) = (rejected[chain[next]].place, cell(chain[next]));
            next += 1;
            let beside = (0..27).map(|n| [x + n % 3 - 1, y + n / 3 % 3 - 1, z + n / 9 - 1]);
            for &i in beside.filter_map(|at| cells.get(&at)).flatten() {
                let other = rejected[i];
                if !done[i] && other.reason == reason && norm(sub(other.place, here)) <= reach {
                    done[i] = true;
                    chain.push(i);
                }
            }
        }
        // What is near is worse, but of what could be far off.
        let sign = if reason == StretchReason::Unresolved { -1.0 } else { 1.0 };
        let badness = |d: &&Rejected| sign * d.measured;
        let of_chain = chain.iter().map(|&i| rejected[i]);
        let worst = of_chain.min_by(|a, b| badness(a).total_cmp(&badness(b))).unwrap_or(rejected[first]);
        found.push(Stretch {
            reason,
            length_mm: chain.iter().map(|&i| length(sampler, plane, rejected[i].normal)).sum(),
            measured: worst.measured,
            limit: worst.limit,
        });
    }
    found
}
