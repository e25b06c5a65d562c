//! Every crossing of the skin with a grid line, in its true place.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::candidate::Candidate;
use super::crossing::Crossing;
use super::edge_fit::{self, Profile};
use super::local_levels::{AtSkin, LocalLevels, median};
use super::rejected::Rejected;
use super::split::parted;
use crate::geometry::{Axis, Plane, PlaneSet, Vec3, cross, dot, normalised};
use crate::pipeline::precise::grid::index::{Voxel, VoxelPlace};
use crate::pipeline::precise::reason::StretchReason;
use crate::pipeline::precise::scan::edge_spread::EdgeSpread;
use crate::pipeline::precise::scan::sampler::Sampler;
use crate::pipeline::precise::scan::{Scan, field_of_view};

/// An edge that the fit puts further than this from the middle of its two voxels is not seen there,
/// voxels.
const FURTHEST: f64 = 2.0;

/// Measures each candidate; and those whose edge is not seen where it should be.
pub(crate) fn measure(
    scan: &Scan<'_>,
    edge_spread: &EdgeSpread,
    local: &LocalLevels,
    candidates: &[Candidate],
) -> (Vec<Crossing>, Vec<Rejected>) {
    let Scan { sampler, levels, .. } = scan;
    let steep = Steep::new(sampler);
    let (usual_air, usual_decline) = rayon::join(
        || median(sampler.asked(), (0..candidates.len()).map(|i| local.at(i).air)),
        || median(sampler.asked(), candidates.iter().map(|c| c.decline)),
    );
    let crossing = |(i, c): (usize, &Candidate)| {
        let doubt = |reason, measured, limit| Rejected {
            place: c.place,
            normal: c.normal,
            axis: c.axis,
            inner: c.inner,
            reason,
            measured,
            limit,
        };
        sampler.ask_at(i);
        let AtSkin { tissue, air } = local.at(i);
        let contrast = f64::from(tissue - air);
        let step = sampler.mean_step(usize::from(c.axis));
        let across = dot(c.normal, step).abs();
        let sigma = edge_spread.along(c.normal);
        let profile = Profile {
            shares: profile(sampler, c).map(|v| f64::from(v - air) / contrast),
            slope: across / sigma,
            noise: f64::from(levels.noise) / contrast,
            least_share: levels.least_share(tissue, air),
        };
        let edge = edge_fit::fit(&profile);
        let off = (edge.place - 0.5).abs();
        if off > FURTHEST {
            return Err(doubt(StretchReason::Unresolved, off * across, FURTHEST * across));
        }
        let mut index = VoxelPlace(c.inner.map(f64::from));
        let axis = usize::from(c.axis);
        index[axis] += if c.ascending { edge.place } else { -edge.place };
        // Beyond the first and the last voxel nothing was measured.
        if !(0.0..=(sampler.shape[axis] - 1) as f64).contains(&index[axis]) {
            return Err(doubt(
                StretchReason::FieldOfView,
                0.0,
                field_of_view::RIM as f64 * sampler.largest_pixel(),
            ));
        }
        Ok(Crossing {
            place: sampler.lps(index),
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
    parted(sampler.asked(), candidates.par_iter().enumerate().map(crossing))
}

/// Six voxels along the line, from the tissue to the air; the candidate's two in the middle.
pub(crate) fn profile(sampler: &Sampler, c: &Candidate) -> [f32; 6] {
    let axis = usize::from(c.axis);
    let index = Voxel(c.inner.map(usize::from));
    let last = sampler.shape[axis] - 1;
    std::array::from_fn(|i| {
        let mut at = index;
        at[axis] = if c.ascending {
            (index[axis] + i).saturating_sub(2).min(last)
        } else {
            (index[axis] + 2).saturating_sub(i).min(last)
        };
        sampler.voxel(at)
    })
}

/// Which planes cut the skin steeply.
struct Steep {
    normals: [Vec3; 3],
}

/// Least sine of the angle between skin and plane.
const LEAST_SINE: f64 = 0.5;

impl Steep {
    fn new(sampler: &Sampler) -> Self {
        let [z, y, x] = [Axis::Z, Axis::Y, Axis::X].map(|a| sampler.mean_step(a as usize));
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
