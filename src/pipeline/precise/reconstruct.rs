//! The steps of the profile, one after the other.

use rayon::prelude::*;

use super::agreement::{Agreement, Neighbourhood};
use super::confidence::Confidence;
use super::crossings::{self, Candidate, Crossing, Doubtful};
use super::head::Head;
use super::levels::Levels;
use super::outside::Outside;
use super::patient::Patient;
use super::quality::{Quality, QualityLimits, Verdict};
use super::regions::Regions;
use super::skin::{BorderPoint, NoSkin, Skin, SkinPoint};
use super::space::Space;
use super::stretches::{StretchReason, rows};
use super::width::Width;
use super::{between, leaves, order};
use crate::dicom::Volume;
use crate::geometry::{Plane, Vec3, dot, norm};
use crate::pipeline::{Observer, Stage};

/// Less soft tissue within bone than this is no head, cm³.
const LEAST_BRAIN_CM3: f64 = 200.0;

/// The skin of the head in `volume`, one point for each leaf of `leaf_mm`.
///
/// # Errors
/// Why there is no skin in it, or that the observer asked to stop.
pub fn reconstruct(
    volume: &Volume,
    leaf_mm: f64,
    limits: &QualityLimits,
    observer: &dyn Observer,
) -> Result<Skin, NoSkin> {
    let go_on = |stage, fraction| {
        observer.progress(stage, fraction);
        if observer.cancelled() { Err(NoSkin::Cancelled) } else { Ok(()) }
    };
    let space = Space::new(volume).ok_or(NoSkin::NoVolume)?;
    let levels = Levels::of(&space).ok_or(NoSkin::NoLevels)?;
    go_on(Stage::Axial, 0.0)?;
    let patient = Patient::find(&space, &levels).ok_or(NoSkin::NoPatient)?;
    go_on(Stage::Axial, 0.5)?;
    let head = Head::of(&space, &levels, &patient);
    if head.brain_cm3 < LEAST_BRAIN_CM3 {
        return Err(NoSkin::NoHead { brain_cm3: head.brain_cm3, limit_cm3: LEAST_BRAIN_CM3 });
    }
    let outside = Outside::find(&space, &patient);
    go_on(Stage::Axial, 1.0)?;
    if let Ok(f) = std::env::var("KINDS") {
        // DEBUG
        let c = &patient.cells; // DEBUG
        let mut b: Vec<u8> = Vec::new(); // DEBUG
        for v in c.shape {
            b.extend((v as u32).to_le_bytes());
        } // DEBUG
        for v in c.origin {
            b.extend(v.to_le_bytes());
        } // DEBUG
        b.extend(c.edge.to_le_bytes()); // DEBUG
        b.extend(patient.kinds.iter().map(|k| *k as u8)); // DEBUG
        b.extend(outside.debug()); // DEBUG
        std::fs::write(f, b).unwrap(); // DEBUG
    } // DEBUG
    let (mut candidates, doubtful) = crossings::candidates(&space, &levels, &patient, &outside);
    drop((patient, outside));
    if candidates.is_empty() {
        return Err(NoSkin::NoBorder);
    }
    go_on(Stage::Sagittal, 0.5)?;
    let rough = Regions::of(&candidates, &levels);
    let width = Width::of(&space, &candidates, &rough);
    crossings::refine_levels(&space, &width, &rough, &mut candidates);
    let regions = Regions::of(&candidates, &levels);
    let measured = crossings::measure(&space, &levels, &width, &regions, &candidates);
    let slices = rows(&space, &candidates, &doubtful);
    let border = border(&space, &candidates, &doubtful);
    drop(candidates);
    go_on(Stage::Coronal, 0.5)?;
    let accepted_mm2: f64 = measured.iter().map(|c| share_of_skin(&space, c.axis, c.normal)).sum();
    let rejected_mm2: f64 = doubtful
        .iter()
        .filter(|d| d.reason != StretchReason::Canal)
        .map(|d| share_of_skin(&space, d.axis, d.normal))
        .sum();
    let all = between::fill(&space, measured);
    go_on(Stage::Downsampling, 0.0)?;
    let stated = State::new(&space, &all);
    let (points, agreements) = stated.points(&all, leaf_mm);
    let mut measured_of = [0; 3];
    let uniplanar = Plane::ALL.map(|plane| {
        let of_plane: Vec<Crossing> = all.iter().filter(|c| c.planes.contains(plane)).copied().collect();
        measured_of[plane.index()] = of_plane.len() as u64;
        let (mut points, _) = stated.points(&of_plane, leaf_mm);
        for point in &mut points {
            point.planes = plane.into();
        }
        points
    });
    let (agreement_mean_mm, agreement_p95_mm) = spread(&agreements);
    let mut quality = Quality {
        verdict: Verdict::Good,
        doubts: Vec::new(),
        coverage: accepted_mm2 / (accepted_mm2 + rejected_mm2),
        rejected_cm2: rejected_mm2 / 100.0,
        agreement_mean_mm,
        agreement_p95_mm,
        noise_hu: f64::from(levels.noise),
        edge_in_plane_mm: width.in_plane,
        edge_across_mm: width.across,
        slice_mm: widest_gap(&space),
        cut_cm2: [head.cut_above_cm2, head.brain_cut_cm2, head.cut_aside_cm2],
        metal_cm3: head.metal_cm3,
    };
    quality.judge(limits);
    go_on(Stage::Downsampling, 1.0)?;
    Ok(Skin { points, uniplanar, quality, slices, border, measured: measured_of })
}

/// The crossings as they lie in the slices.
#[expect(clippy::cast_possible_truncation)]
fn border(space: &Space, candidates: &[Candidate], doubtful: &[Doubtful]) -> Vec<BorderPoint> {
    let point = |place: Vec3, axis: u8, reason| {
        let mut index = space.index(place);
        for (a, v) in index.iter_mut().enumerate().filter(|(a, _)| *a != usize::from(axis)) {
            debug_assert!((*v - v.round()).abs() < 1e-3, "a line follows one axis, not {a}");
            *v = v.round();
        }
        BorderPoint { index: index.map(|v| v as f32), axis, reason }
    };
    let accepted = candidates.iter().map(|c| point(c.place, c.axis, None));
    accepted.chain(doubtful.iter().map(|d| point(d.place, d.axis, Some(d.reason)))).collect()
}

/// What is needed to state a point's error.
struct State<'a> {
    neighbourhood: Neighbourhood<'a>,
    confidence: Confidence,
}

impl<'a> State<'a> {
    fn new(space: &Space, all: &'a [Crossing]) -> Self {
        Self { neighbourhood: Neighbourhood::of(all), confidence: Confidence::of(space) }
    }

    /// One point for each leaf, with its error, in level-of-detail order.
    #[expect(clippy::cast_possible_truncation)]
    fn points(&self, crossings: &[Crossing], leaf: f64) -> (Vec<SkinPoint>, Vec<Agreement>) {
        let thin = leaves::thin(crossings, leaf);
        let places: Vec<Vec3> = thin.iter().map(|c| c.place).collect();
        order::by_detail(&places, leaf)
            .into_par_iter()
            .map(|i| {
                let c = &thin[i as usize];
                let agreement = self.neighbourhood.agreement(c);
                let point = SkinPoint {
                    place: c.place.map(|v| v as f32),
                    normal: c.normal.map(|v| v as f32),
                    error: self.confidence.error(c, &agreement) as f32,
                    planes: c.planes,
                };
                (point, agreement)
            })
            .unzip()
    }
}

/// The skin's area that a crossing stands for, mm²: that of a voxel's face, tilted, for the lines
/// that meet the skin most steeply; the others would count it again.
fn share_of_skin(space: &Space, axis: u8, normal: Vec3) -> f64 {
    let cosine = |a: usize| {
        let step = space.mean_step(a);
        dot(normal, step).abs() / norm(step)
    };
    let own = cosine(usize::from(axis));
    if (0..3).any(|a| cosine(a) > own) {
        return 0.0;
    }
    let face: f64 = (0..3).filter(|&a| a != usize::from(axis)).map(|a| norm(space.mean_step(a))).product();
    face / own
}

/// Mean and 95th percentile of the offsets.
#[expect(clippy::cast_precision_loss)]
fn spread(agreements: &[Agreement]) -> (f64, f64) {
    let mut offsets: Vec<f64> = agreements.iter().filter(|a| a.is_known()).map(|a| a.offset.abs()).collect();
    if offsets.is_empty() {
        return (0.0, 0.0);
    }
    let mean = offsets.iter().sum::<f64>() / offsets.len() as f64;
    let rank = offsets.len() * 95 / 100;
    let (_, p95, _) = offsets.select_nth_unstable_by(rank, f64::total_cmp);
    (mean, *p95)
}

fn widest_gap(space: &Space) -> f64 {
    let axis = space.slice_axis();
    (0..space.shape[axis] - 1).map(|k| space.spacing(axis, k)).fold(0.0, f64::max)
}
