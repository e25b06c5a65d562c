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
use super::leaves::Leaf;
use super::{between, leaves, order};
use crate::dicom::Volume;
use crate::geometry::{Plane, PlaneSet, Vec3, dot, norm};
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
    let t0 = std::time::Instant::now(); // DEBUG
    let lap = |w: &str| if std::env::var("T").is_ok() { eprintln!("{:8.3} {w}", t0.elapsed().as_secs_f64()) }; // DEBUG
    let space = Space::new(volume).ok_or(NoSkin::NoVolume)?;
    let levels = Levels::of(&space).ok_or(NoSkin::NoLevels)?;
    go_on(Stage::Axial, 0.0)?;
    lap("levels"); // DEBUG
    let patient = Patient::find(&space, &levels).ok_or(NoSkin::NoPatient)?;
    go_on(Stage::Axial, 0.5)?;
    lap("patient"); // DEBUG
    let head = Head::of(&space, &levels, &patient);
    if head.brain_cm3 < LEAST_BRAIN_CM3 {
        return Err(NoSkin::NoHead { brain_cm3: head.brain_cm3, limit_cm3: LEAST_BRAIN_CM3 });
    }
    lap("head"); // DEBUG
    let outside = Outside::find(&space, &patient);
    go_on(Stage::Axial, 1.0)?;
    if let Ok(f) = std::env::var("KINDS") { // DEBUG
        let c = &patient.survey.cells; // DEBUG
        let mut b: Vec<u8> = Vec::new(); // DEBUG
        for v in c.shape { b.extend((v as u32).to_le_bytes()); } // DEBUG
        for v in c.origin { b.extend(v.to_le_bytes()); } // DEBUG
        b.extend(c.edge.to_le_bytes()); // DEBUG
        b.extend(patient.kinds.iter().map(|k| *k as u8)); // DEBUG
        b.extend(outside.debug()); // DEBUG
        std::fs::write(f, b).unwrap(); // DEBUG
    } // DEBUG
    lap("outside"); // DEBUG
    let (mut candidates, doubtful) = crossings::candidates(&space, &levels, &patient, &outside);
    drop((patient, outside));
    if candidates.is_empty() {
        return Err(NoSkin::NoBorder);
    }
    go_on(Stage::Sagittal, 0.5)?;
    lap("candidates"); // DEBUG
    let rough = Regions::of(&candidates, &levels);
    lap("regions"); // DEBUG
    let width = Width::of(&space, &candidates, &rough);
    crossings::refine_levels(&space, &width, &rough, &mut candidates);
    let regions = Regions::of(&candidates, &levels);
    let measured = crossings::measure(&space, &levels, &width, &regions, &candidates);
    lap("measure"); // DEBUG
    let slices = rows(&space, &candidates, &doubtful);
    let border = border(&space, &candidates, &doubtful);
    drop(candidates);
    go_on(Stage::Coronal, 0.5)?;
    lap("rows+border"); // DEBUG
    let accepted_mm2: f64 = measured.iter().map(|c| share_of_skin(&space, c.axis, c.normal)).sum();
    let rejected_mm2: f64 = doubtful
        .iter()
        .filter(|d| d.reason != StretchReason::Canal)
        .map(|d| share_of_skin(&space, d.axis, d.normal))
        .sum();
    lap("areas"); // DEBUG
    let all = between::fill(&space, measured);
    go_on(Stage::Downsampling, 0.0)?;
    lap("fill"); // DEBUG
    let clouds = Clouds::of(&space, &all, leaf_mm);
    let (agreement_mean_mm, agreement_p95_mm) = spread(&clouds.agreements);
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
    let Clouds { points, uniplanar, measured, .. } = clouds;
    Ok(Skin { points, uniplanar, quality, slices, border, measured })
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

/// The downsampled clouds.
struct Clouds {
    points: Vec<SkinPoint>,
    uniplanar: [Vec<SkinPoint>; 3],
    /// Crossings of each plane.
    measured: [u64; 3],
    /// Of the points of the merged cloud.
    agreements: Vec<Agreement>,
}

impl Clouds {
    /// One point for each leaf, of all crossings and of each plane's, with its error, in
    /// level-of-detail order.
    fn of(space: &Space, all: &[Crossing], leaf: f64) -> Self {
        let merged = leaves::thin(all, leaf, |_| true);
        let of_plane = Plane::ALL.map(|plane| leaves::thin(all, leaf, |c| c.planes.contains(plane)));
        // Most crossings that stand for a leaf do so in several clouds.
        let mut chosen: Vec<u32> =
            merged.iter().chain(of_plane.iter().flatten()).map(|leaf| leaf.crossing).collect();
        chosen.par_sort_unstable();
        chosen.dedup();
        let neighbourhood = Neighbourhood::of(all);
        let confidence = Confidence::of(space);
        let stated: Vec<(Agreement, f64)> = chosen
            .par_iter()
            .map(|&i| {
                let c = &all[i as usize];
                let agreement = neighbourhood.agreement(c.place, c.normal);
                (agreement, confidence.error(c, &agreement))
            })
            .collect();
        if let Ok(f) = std::env::var("DUMP") { // DEBUG
            let mut b: Vec<u8> = Vec::new(); // DEBUG
            let (px, gap) = (0.0, 0.0); // DEBUG
            for l in &merged { // DEBUG
                let c = &all[l.crossing as usize]; let (a, e) = &stated[chosen.partition_point(|&i| i < l.crossing)]; // DEBUG
                for v in [c.place[0], c.place[1], c.place[2], c.normal[0], c.normal[1], c.normal[2], c.error, c.coarseness, f64::from(u8::from(c.between)), f64::from(c.axis), a.offset, a.scatter, a.curvature, a.debug() as f64, px, gap, *e] { b.extend((v as f32).to_le_bytes()); } // DEBUG
            } // DEBUG
            std::fs::write(f, b).unwrap(); // DEBUG
        } // DEBUG
        let state = |leaf: &Leaf| &stated[chosen.partition_point(|&i| i < leaf.crossing)];
        let cloud = |leaves: &[Leaf], planes: Option<Plane>| {
            let places: Vec<Vec3> = leaves.iter().map(|l| all[l.crossing as usize].place).collect();
            let point = |i: &u32| {
                let leaf = &leaves[*i as usize];
                let planes = planes.map_or(leaf.planes, PlaneSet::from);
                SkinPoint::of(&all[leaf.crossing as usize], state(leaf).1, planes)
            };
            order::by_detail(&places, leaf).par_iter().map(point).collect()
        };
        let count = |plane| all.iter().filter(|c| c.planes.contains(plane)).count() as u64;
        Self {
            points: cloud(&merged, None),
            uniplanar: [0, 1, 2].map(|i| cloud(&of_plane[i], Some(Plane::ALL[i]))),
            measured: Plane::ALL.map(count),
            agreements: merged.iter().map(|leaf| state(leaf).0).collect(),
        }
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
