//! The report on every slice: how much of its contour is accepted, and which stretches of it are
//! not. A bad spot costs its own stretch, not the slice.

use std::collections::{BTreeMap, HashMap};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::candidates::Doubtful;
use super::crossings::Crossing;
use super::space::Space;
use crate::geometry::{Plane, Vec3, dot, norm, sub};
use crate::pipeline::slices;

/// Why a stretch of contour was not accepted.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, utoipa::ToSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum StretchReason {
    /// It is not the patient's border but that of what touches the patient: a couch, a holder, a
    /// mask, a strap.
    Foreign,
    /// Something foreign touches the skin right beside.
    Touching,
    /// A mask, a strap, a pad, a fiducial lies on the skin without a gap: a ledge runs around it.
    Covered,
    /// The image or its field of view ends here.
    FieldOfView,
    /// The rim of a nostril, an ear canal or the mouth: behind it is inside.
    Canal,
    /// The voxels do not tell where exactly the skin is: only one of two slices that lie far apart
    /// shows it, no edge is seen, or a layer that is no clear tissue lies on it (a bandage, a gel,
    /// thick hair).
    Unresolved,
}

impl StretchReason {
    /// All reasons.
    pub const ALL: [Self; 6] =
        [Self::Foreign, Self::Touching, Self::Covered, Self::FieldOfView, Self::Canal, Self::Unresolved];

    /// The one name in report, metrics and documentation.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Foreign => "foreign",
            Self::Touching => "touching",
            Self::Covered => "covered",
            Self::FieldOfView => "field_of_view",
            Self::Canal => "canal",
            Self::Unresolved => "unresolved",
        }
    }
}

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
pub(super) fn rows(space: &Space, measured: &[Crossing], doubtful: &[Doubtful]) -> Vec<SliceContour> {
    let mut accepted: BTreeMap<(Plane, u16), f64> = BTreeMap::new();
    let mut rejected: BTreeMap<(Plane, u16), Vec<&Doubtful>> = BTreeMap::new();
    for (i, c) in measured.iter().enumerate() {
        space.ask_at(i);
        let index = space.index(c.place);
        for plane in planes_of(c.axis) {
            *accepted.entry((plane, index[across(plane)].round() as u16)).or_default() +=
                length(space, plane, c.normal);
        }
    }
    for (i, d) in doubtful.iter().enumerate() {
        space.ask_at(i);
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
            rejected: rejected.get(&(plane, index)).map_or_else(Vec::new, |d| stretches(space, plane, d)),
        })
        .collect()
}

/// The array axis along which a plane's slices are counted.
pub(super) fn across(plane: Plane) -> usize {
    slices::axis(plane) as usize
}

/// The two planes that a line along an axis lies in.
fn planes_of(axis: u8) -> impl Iterator<Item = Plane> {
    Plane::ALL.into_iter().filter(move |&p| across(p) != usize::from(axis))
}

/// The length of contour that one crossing stands for: in a slice, a contour of unit length with
/// the normal n crosses |nₐ| / sₐ + |n_b| / s_b lines.
fn length(space: &Space, plane: Plane, normal: Vec3) -> f64 {
    let in_plane = (0..3).filter(|&a| a != across(plane)).map(|a| {
        let step = space.mean_step(a);
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
fn stretches(space: &Space, plane: Plane, rejected: &[&Doubtful]) -> Vec<Stretch> {
    let reach =
        APART * (0..3).filter(|&a| a != across(plane)).map(|a| norm(space.mean_step(a))).fold(0.0, f64::max);
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
            space.ask_at(next);
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
        let badness = |d: &&Doubtful| sign * d.measured;
        let of_chain = chain.iter().map(|&i| rejected[i]);
        let worst = of_chain.min_by(|a, b| badness(a).total_cmp(&badness(b))).unwrap_or(rejected[first]);
        found.push(Stretch {
            reason,
            length_mm: chain.iter().map(|&i| length(space, plane, rejected[i].normal)).sum(),
            measured: worst.measured,
            limit: worst.limit,
        });
    }
    found
}
