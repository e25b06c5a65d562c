//! The steps of the profile, one after the other.

use rayon::prelude::*;

use super::border::between_slices::BetweenSlices;
use super::border::crossing::Crossing;
use super::border::local_levels::{LocalLevels, MOST_AIR_OF_WIDE, most_air};
use super::border::rejected::Rejected;
use super::border::{candidates, crossings, plateau};
use super::cloud::leaves::{Leaf, Rivals};
use super::cloud::order;
use super::confidence::agreement::{Agreement, Neighbourhood};
use super::confidence::error::Confidence;
use super::confidence::motion::largest_step;
use super::labels::head::Head;
use super::labels::outside::Outside;
use super::labels::patient::Patient;
use super::reason::StretchReason;
use super::report::assess::{self, Areas};
use super::report::quality::{Quality, QualityLimits};
use super::report::stretches::rows;
use super::rules::covered::Covered;
use super::scan::edge_spread::EdgeSpread;
use super::scan::empty_ends;
use super::scan::field_of_view::FieldOfView;
use super::scan::levels::Levels;
use super::scan::sampler::{Sampler, along_coarsest};
use super::skin::{BorderPoint, NoSkin, Skin, SkinPoint};
use crate::dicom::Volume;
use crate::geometry::{Plane, PlaneSet, Vec3};
use crate::observer::stop::unless_stopped;
use crate::observer::{Observer, Stage};
use crate::pipeline::precise::border::edge_spread;

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
    unless_stopped(|| of_held(volume, leaf_mm, limits, observer)).unwrap_or(Err(NoSkin::Cancelled))
}

/// The skin in the slices that hold something.
fn of_held(
    volume: &Volume,
    leaf_mm: f64,
    limits: &QualityLimits,
    observer: &dyn Observer,
) -> Result<Skin, NoSkin> {
    let grid = along_coarsest(&volume.grid);
    let all = 0..grid.slice_origins().len();
    let whole = empty_ends::part(volume, &grid, all.clone());
    let sampler = whole.space(observer).ok_or(NoSkin::NoVolume)?;
    let levels = Levels::of(&sampler).ok_or(NoSkin::NoLevels)?;
    let held = empty_ends::held(&sampler, &levels);
    let doubtful = volume.doubtful_slices.len();
    if held == all {
        return skin(&sampler, &levels, leaf_mm, limits, doubtful, observer);
    }
    let part = empty_ends::part(volume, &grid, held.clone());
    let sampler = part.space(observer).ok_or(NoSkin::NoVolume)?;
    let levels = Levels::of(&sampler).ok_or(NoSkin::NoLevels)?;
    let mut skin = skin(&sampler, &levels, leaf_mm, limits, doubtful, observer)?;
    skin.count_from(sampler.slice_axis(), held.start);
    Ok(skin)
}

/// The skin of the head in a scan that holds something from end to end, of which so many slices are
/// doubtful.
fn skin(
    sampler: &Sampler,
    levels: &Levels,
    leaf_mm: f64,
    limits: &QualityLimits,
    doubtful_slices: usize,
    observer: &dyn Observer,
) -> Result<Skin, NoSkin> {
    let go_on = |stage, fraction| {
        observer.progress(stage, fraction);
        if observer.cancelled() { Err(NoSkin::Cancelled) } else { Ok(()) }
    };
    go_on(Stage::Patient, 0.0)?;
    let field = FieldOfView::of(sampler, levels);
    let patient = Patient::find(sampler, levels, &field).ok_or(NoSkin::NoPatient)?;
    go_on(Stage::Patient, 1.0)?;
    let head = Head::of(sampler, levels, &field, &patient);
    if head.brain_cm3 < LEAST_BRAIN_CM3 {
        return Err(NoSkin::NoHead { brain_cm3: head.brain_cm3, limit_cm3: LEAST_BRAIN_CM3 });
    }
    let outside = Outside::find(sampler.asked(), &patient.survey, &patient.labels, &patient.field_border);
    go_on(Stage::Outside, 1.0)?;
    let (mut candidates, mut doubtful) = candidates::find(sampler, levels, &field, &patient, &outside);
    drop(outside);
    if candidates.is_empty() {
        return Err(NoSkin::NoBorder);
    }
    go_on(Stage::Crossings, 0.4)?;
    sampler.ask();
    let rough = LocalLevels::of(sampler.asked(), &candidates, levels, MOST_AIR_OF_WIDE);
    sampler.ask();
    let width = edge_spread::measure(sampler, levels, &candidates, &rough);
    sampler.ask();
    plateau::refine_levels(sampler, &width, &rough, &mut candidates);
    sampler.ask();
    let regions = rough.again(sampler.asked(), &candidates, levels, most_air(&width));
    sampler.ask();
    let (mut measured, unclear) = crossings::measure(sampler, levels, &width, &regions, &candidates);
    drop(candidates);
    doubtful.extend(unclear);
    sampler.ask();
    let between = BetweenSlices::of(sampler, &measured);
    if let Some(between) = &between {
        doubtful.extend(between.settle(sampler, &mut measured));
    }
    sampler.ask();
    let mut filled = between.map(|between| between.fill(sampler, measured.clone()));
    let of_canals = doubtful.iter().filter(|d| d.reason == StretchReason::Canal);
    let canals: Vec<Vec3> = of_canals.map(|d| d.place).collect();
    let near_foreign = |place| patient.is_near_foreign(place);
    let all = filled.as_ref().unwrap_or(&measured);
    sampler.ask();
    let covered = Covered::of(sampler, levels, all, &canals, near_foreign);
    sampler.ask();
    doubtful.extend(covered.take(sampler, &mut measured));
    if let Some(filled) = &mut filled {
        let mut item = 0;
        filled.retain(|c| {
            item += 1;
            sampler.ask_at(item);
            !covered.holds(c.place)
        });
    }
    go_on(Stage::Crossings, 1.0)?;
    let all = filled.as_ref().unwrap_or(&measured);
    go_on(Stage::Downsampling, 0.0)?;
    // What one thread does alone, beside what all do.
    let (clouds, ((slices, border), (areas, motion_mm))) = rayon::join(
        || Clouds::of(sampler, &width, all, leaf_mm),
        || {
            rayon::join(
                || (rows(sampler, &measured, &doubtful), border(sampler, &measured, &doubtful)),
                || {
                    sampler.ask();
                    let areas = Areas::of(sampler, &patient, &head, &measured, &doubtful);
                    sampler.ask();
                    (areas, largest_step(sampler, all, head.middle))
                },
            )
        },
    );
    let quality = assess::quality(sampler, levels, &width, &head, &areas, motion_mm, &clouds.agreements);
    let quality = Quality { doubtful_slices, ..quality }.judge(limits);
    go_on(Stage::Downsampling, 1.0)?;
    let Clouds { points, uniplanar, measured, .. } = clouds;
    Ok(Skin { points, uniplanar, quality, slices, border, measured })
}

/// The crossings as they lie in the slices.
fn border(sampler: &Sampler, measured: &[Crossing], doubtful: &[Rejected]) -> Vec<BorderPoint> {
    let point = |place: Vec3, axis: u8, reason| {
        sampler.ask();
        let mut index = sampler.index(place);
        for (a, v) in index.iter_mut().enumerate().filter(|(a, _)| *a != usize::from(axis)) {
            debug_assert!((*v - v.round()).abs() < 1e-3, "a line follows one axis, not {a}");
            *v = v.round();
        }
        BorderPoint { index: index.map(|v| v as f32), axis, reason }
    };
    let accepted = measured.par_iter().panic_fuse().map(|c| point(c.place, c.axis, None));
    accepted.chain(doubtful.par_iter().panic_fuse().map(|d| point(d.place, d.axis, Some(d.reason)))).collect()
}

/// The clouds that are made: of all planes, and of each.
const MERGED_AND_PLANES: [Option<Plane>; 4] =
    [None, Some(Plane::Axial), Some(Plane::Sagittal), Some(Plane::Coronal)];

/// The downsampled clouds.
struct Clouds {
    points: Vec<SkinPoint>,
    uniplanar: [Vec<SkinPoint>; 3],
    /// Crossings of each plane.
    measured: [u64; 3],
    /// Place and agreement of the points of the merged cloud.
    agreements: Vec<(Vec3, Agreement)>,
}

impl Clouds {
    /// One point for each leaf, of all crossings and of each plane's, with its error, in
    /// level-of-detail order.
    fn of(sampler: &Sampler, width: &EdgeSpread, all: &[Crossing], leaf: f64) -> Self {
        let is_of = |c: &Crossing, plane: Option<Plane>| plane.is_none_or(|plane| c.planes.contains(plane));
        let rivals = Rivals::of(sampler.asked(), all);
        let thinned = |plane: &Option<Plane>| {
            sampler.ask();
            rivals.thin(leaf, |c| is_of(c, *plane))
        };
        let thinned: Vec<Vec<Leaf>> = MERGED_AND_PLANES.par_iter().panic_fuse().map(thinned).collect();
        // Most crossings that stand for a leaf do so in several clouds.
        let mut chosen: Vec<u32> = thinned.iter().flatten().map(|leaf| leaf.crossing).collect();
        chosen.par_sort_unstable_by(|a, b| {
            sampler.ask_at(*a as usize);
            a.cmp(b)
        });
        chosen.dedup();
        sampler.ask();
        let neighbourhood = Neighbourhood::of(sampler.asked(), all);
        let confidence = Confidence::of(sampler, width);
        let stated: Vec<(Agreement, f64)> = chosen
            .par_iter()
            .panic_fuse()
            .map(|&i| {
                sampler.ask();
                let c = &all[i as usize];
                let agreement = neighbourhood.agreement(i as usize);
                (agreement, confidence.error(c, &agreement))
            })
            .collect();
        let state = |leaf: &Leaf| &stated[chosen.partition_point(|&i| i < leaf.crossing)];
        let cloud = |(leaves, plane): (&Vec<Leaf>, &Option<Plane>)| -> Vec<SkinPoint> {
            sampler.ask();
            let places: Vec<Vec3> = leaves.iter().map(|l| all[l.crossing as usize].place).collect();
            let point = |i: &u32| {
                let leaf = &leaves[*i as usize];
                let planes = plane.map_or(leaf.planes, PlaneSet::from);
                let (agreement, error) = state(leaf);
                SkinPoint::of(&all[leaf.crossing as usize], agreement.normal, *error, planes)
            };
            order::by_detail(sampler.asked(), &places, leaf).par_iter().map(point).collect()
        };
        let clouds: Vec<Vec<SkinPoint>> =
            thinned.par_iter().zip(&MERGED_AND_PLANES).panic_fuse().map(cloud).collect();
        let mut clouds = clouds.into_iter();
        let mut next = || clouds.next().unwrap_or_default();
        let agreement = |leaf: &Leaf| (all[leaf.crossing as usize].place, state(leaf).0);
        let in_planes = |c: &Crossing| Plane::ALL.map(|plane| u64::from(c.planes.contains(plane)));
        let sum = |a: [u64; 3], b: [u64; 3]| std::array::from_fn(|i| a[i] + b[i]);
        Self {
            points: next(),
            uniplanar: Plane::ALL.map(|_| next()),
            measured: all.par_iter().map(in_planes).reduce(|| [0; 3], sum),
            agreements: thinned[0].par_iter().map(agreement).collect(),
        }
    }
}
