//! Every crossing of the skin with a grid line, in its true place.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::candidates::{Candidate, Doubtful};
use super::edge::{self, Profile};
use super::field;
use super::levels::Levels;
use super::parted::parted;
use super::regions::{Regions, median};
use super::space::Space;
use super::stretches::StretchReason;
use super::width::Width;
use crate::geometry::{Axis, Plane, PlaneSet, Vec3, cross, dot, normalised};

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

/// An edge that the fit puts further than this from the middle of its two voxels is not seen there,
/// voxels.
const FURTHEST: f64 = 2.0;

/// Measures each candidate; and those whose edge is not seen where it should be.
pub(super) fn measure(
    space: &Space,
    levels: &Levels,
    width: &Width,
    regions: &Regions,
    candidates: &[Candidate],
) -> (Vec<Crossing>, Vec<Doubtful>) {
    let steep = Steep::new(space);
    let (usual_air, usual_decline) = rayon::join(
        || median(space.asked(), (0..candidates.len()).map(|i| regions.levels(i).1)),
        || median(space.asked(), candidates.iter().map(|c| c.decline)),
    );
    let crossing = |(i, c): (usize, &Candidate)| {
        let doubt = |reason, measured, limit| Doubtful {
            place: c.place,
            normal: c.normal,
            axis: c.axis,
            inner: c.inner,
            reason,
            measured,
            limit,
        };
        space.ask_at(i);
        let (tissue, air) = regions.levels(i);
        let contrast = f64::from(tissue - air);
        let step = space.mean_step(usize::from(c.axis));
        let across = dot(c.normal, step).abs();
        let sigma = width.along(c.normal);
        let profile = Profile {
            shares: profile(space, c).map(|v| f64::from(v - air) / contrast),
            slope: across / sigma,
            noise: f64::from(levels.noise) / contrast,
            least_share: levels.least_share(tissue, air),
        };
        let edge = edge::fit(&profile);
        let off = (edge.place - 0.5).abs();
        if off > FURTHEST {
            return Err(doubt(StretchReason::Unresolved, off * across, FURTHEST * across));
        }
        let mut index = c.inner.map(f64::from);
        let axis = usize::from(c.axis);
        index[axis] += if c.ascending { edge.place } else { -edge.place };
        // Beyond the first and the last voxel nothing was measured.
        if !(0.0..=(space.shape[axis] - 1) as f64).contains(&index[axis]) {
            return Err(doubt(StretchReason::FieldOfView, 0.0, field::RIM as f64 * space.largest_pixel()));
        }
        Ok(Crossing {
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
    };
    parted(space.asked(), candidates.par_iter().enumerate().map(crossing))
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
