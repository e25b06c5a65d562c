//! What lies on the skin: masks, fiducials, pads, bandages.

use super::{distance, errors, has_point, options};
use triplanar::dicom::Volume;
use triplanar::geometry::{Vec3, norm, sub};
use triplanar::observer::Silent;
use triplanar::phantom::{Options, Phantom};
use triplanar::pipeline::precise::{
    Doubt, Missing, QualityLimits, Side, Skin, SkinPoint, StretchReason, reconstruct,
};

/// Plastic and bandages, HU.
const PLASTIC: f64 = 60.0;
const BANDAGE: f64 = -400.0;

/// The volume with a shell of so many HU on the skin, which is so many mm thick at a place, and the share
/// of skin that it hides.
fn with_shell(phantom: &Phantom, hu: f64, thickness: impl Fn(Vec3) -> f64) -> (Volume, f64) {
    let mut volume = phantom.volume();
    let grid = volume.grid.clone();
    for (index, v) in volume.hu.indexed_iter_mut() {
        let p = grid.lps([index.0, index.1, index.2]);
        let thickness = thickness(p);
        if thickness <= 0.0 {
            continue;
        }
        let outside = phantom.signed_distance(p);
        // With what the edge's half voxels lend to air.
        let share = ((thickness - outside) / 0.9 + 0.5).clamp(0.0, 1.0);
        if outside > -0.45 {
            *v = (*v).max((-1000.0 + (hu + 1000.0) * share) as i16);
        }
    }
    let spots = phantom.skin_points(3.0);
    let share = spots.iter().filter(|p| thickness(**p) > 0.0).count() as f64 / spots.len() as f64;
    (volume, share)
}

/// So many mm where `region` is.
fn of(thickness: f64, region: impl Fn(Vec3) -> bool) -> impl Fn(Vec3) -> f64 {
    move |p| if region(p) { thickness } else { 0.0 }
}

/// What is missing of a side for a reason, cm².
fn missing(skin: &Skin, reason: StretchReason, side: Side) -> f64 {
    let of_both = skin.quality.missing.iter().filter(|m| m.reason == reason && m.side == side);
    of_both.map(|m| m.area_cm2).sum()
}

/// Half of a face, so that left and right can't be mixed up; the rest of the head keeps its skin.
#[test]
fn a_mask_without_a_gap_is_no_skin() {
    let phantom = Phantom::new(Options { slice_mm: 1.5, slices: 120, ..options() }).expect("in range");
    let masked = |[x, y, z]: Vec3| y < -10.0 && x < 15.0 && z.abs() < 60.0;
    let (volume, hidden) = with_shell(&phantom, PLASTIC, of(2.5, masked));
    let skin = reconstruct(&volume, 1.0, &QualityLimits::default(), &Silent).expect("a head");
    let errors = errors(&phantom, &skin);
    let invented = errors.iter().filter(|e| e.abs() > 1.0).count();
    assert!(invented * 500 < errors.len(), "{invented} of {} points lie on the mask", errors.len());
    let of_side = |side| missing(&skin, StretchReason::Covered, side);
    assert!(of_side(Side::Right) > 5.0 * of_side(Side::Left).max(1.0), "{:?}", skin.quality.missing);
    // The neck below is skin in view, but none of the head's.
    let stated = 1.0 - skin.quality.coverage;
    assert!((1.0..1.5).contains(&(stated / hidden)), "{hidden} of all skin is hidden, {stated} missing");
    let free: Vec<Vec3> = phantom.skin_points(3.0).into_iter().filter(|p| !masked(*p)).collect();
    let covered = free.iter().filter(|p| has_point(&skin, **p, 1.5)).count();
    assert!(covered * 100 >= free.len() * 90, "{covered} of {} free spots have a point", free.len());
    assert!(skin.quality.doubts.contains(&Doubt::Coverage), "{:?}", skin.quality.doubts);
}

/// Discs as they are stuck on for navigation.
#[test]
fn fiducials_are_no_skin() {
    let phantom = Phantom::new(Options { slice_mm: 1.5, slices: 120, ..options() }).expect("in range");
    let scalp: Vec<Vec3> = phantom.skin_points(3.0).into_iter().filter(|p| p[2] > 40.0).collect();
    let mut spots: Vec<Vec3> = Vec::new();
    for p in scalp {
        if spots.len() < 4 && spots.iter().all(|s| distance(*s, p) > 45.0) {
            spots.push(p);
        }
    }
    let stuck = |p: Vec3| spots.iter().any(|s| distance(*s, p) < 8.0);
    let (volume, _) = with_shell(&phantom, PLASTIC, of(3.5, stuck));
    let skin = reconstruct(&volume, 1.0, &QualityLimits::default(), &Silent).expect("a head");
    let errors = errors(&phantom, &skin);
    let is_on = |e: &f64| (1.0..5.0).contains(e);
    let on_disc = |spot: &Vec3| {
        let near = |p: &SkinPoint| distance(p.place.map(f64::from), *spot) < 12.0;
        skin.points.iter().zip(&errors).filter(|(p, e)| is_on(e) && near(p)).count()
    };
    let left: Vec<(Vec3, usize)> = spots.iter().map(|spot| (*spot, on_disc(spot))).collect();
    assert!(left.iter().all(|l| l.1 < 10), "points left on the discs at {left:?}");
    let covered = |m: &&Missing| m.reason == StretchReason::Covered;
    let area: f64 = skin.quality.missing.iter().filter(covered).map(|m| m.area_cm2).sum();
    assert!((4.0..30.0).contains(&area), "{area} cm² under four discs of 2 cm²");
}

/// As large as an ear is, but nothing is behind it; and the ears stay.
#[test]
fn a_pad_of_an_ears_size_is_no_skin() {
    let phantom = Phantom::new(Options { slice_mm: 1.5, slices: 120, ..options() }).expect("in range");
    let pad = |[x, y, z]: Vec3| x > 0.0 && (-45.0..0.0).contains(&y) && (15.0..60.0).contains(&z);
    let (volume, _) = with_shell(&phantom, PLASTIC, of(6.0, pad));
    let skin = reconstruct(&volume, 1.0, &QualityLimits::default(), &Silent).expect("a head");
    let left = errors(&phantom, &skin).into_iter().filter(|e| *e > 2.0).count();
    assert!(left < 20, "{left} points lie on the pad");
    let of_side = |side| missing(&skin, StretchReason::Covered, side);
    assert!((15.0..45.0).contains(&of_side(Side::Left)), "{:?}", skin.quality.missing);
    assert!(of_side(Side::Right) < 1.0, "{:?}", skin.quality.missing);
    let free: Vec<Vec3> = phantom.skin_points(3.0).into_iter().filter(|p| !pad(*p) && p[2] > -60.0).collect();
    let found = free.iter().filter(|p| has_point(&skin, **p, 1.5)).count();
    assert!(found * 100 >= free.len() * 98, "{found} of {} free spots have a point", free.len());
}

/// Its wall is a slope of 50°, no steeper than the sides of a nose.
#[test]
fn a_thick_pad_with_a_bevelled_edge_is_no_skin() {
    let phantom = Phantom::new(Options { slice_mm: 1.5, slices: 120, ..options() }).expect("in range");
    let thickness = |[x, y, z]: Vec3| {
        let from_edge = (40.0 - (x - 8.0).abs()).min(30.0 - (z - 30.0).abs());
        if y < 0.0 { (1.2 * from_edge).min(10.0) } else { 0.0 }
    };
    let (volume, hidden) = with_shell(&phantom, PLASTIC, thickness);
    let skin = reconstruct(&volume, 1.0, &QualityLimits::default(), &Silent).expect("a head");
    let left = errors(&phantom, &skin).into_iter().filter(|e| *e > 2.0).count();
    assert!(left * 1000 < skin.points.len(), "{left} points lie on the pad");
    let stated = 1.0 - skin.quality.coverage;
    assert!((0.85..1.6).contains(&(stated / hidden)), "{hidden} of all skin is hidden, {stated} missing");
}

/// The rim of its foot is short: what tells it from a nose is how far it sticks out of it.
#[test]
fn a_finger_on_the_brow_is_no_skin() {
    let phantom = Phantom::new(Options { slice_mm: 1.5, slices: 120, ..options() }).expect("in range");
    let mut volume = phantom.volume();
    let grid = volume.grid.clone();
    let foot = [25.0, -80.0, 25.0];
    for (index, v) in volume.hu.indexed_iter_mut() {
        let p = sub(grid.lps([index.0, index.1, index.2]), foot);
        let along = (p[1] * -0.94 + p[2] * 0.34).clamp(0.0, 50.0);
        let beside = norm(sub(p, [0.0, -0.94 * along, 0.34 * along])) - 8.0;
        let share = (0.5 - beside / 0.9).clamp(0.0, 1.0);
        *v = (*v).max((-1000.0 + 1050.0 * share) as i16);
    }
    let skin = reconstruct(&volume, 1.0, &QualityLimits::default(), &Silent).expect("a head");
    let left = errors(&phantom, &skin).into_iter().filter(|e| *e > 2.0).count();
    assert!(left < 20, "{left} points lie on the finger");
    let total: f64 = skin.quality.missing.iter().map(|m| m.area_cm2).sum();
    let covered = missing(&skin, StretchReason::Covered, Side::Anterior);
    assert!(covered > 10.0 && total < covered + 1.0, "{:?}", skin.quality.missing);
}

/// No edge tells where the skin below it is, and its own outer face is no tissue: what it hides is
/// missing, and the report says so.
#[test]
fn what_a_bandage_hides_is_missing() {
    let phantom = Phantom::new(Options { slice_mm: 1.5, slices: 120, ..options() }).expect("in range");
    let bound = |[x, y, z]: Vec3| x > -20.0 && y < 60.0 && (12.0..45.0).contains(&z);
    let (volume, hidden) = with_shell(&phantom, BANDAGE, of(5.0, bound));
    let skin = reconstruct(&volume, 1.0, &QualityLimits::default(), &Silent).expect("a head");
    let invented = errors(&phantom, &skin).into_iter().filter(|e| *e > 2.0).count();
    assert!(invented * 500 < skin.points.len(), "{invented} points lie on the bandage");
    let of_side = |side| missing(&skin, StretchReason::Unresolved, side);
    assert!(of_side(Side::Left) > 5.0 * of_side(Side::Right).max(1.0), "{:?}", skin.quality.missing);
    let stated = 1.0 - skin.quality.coverage;
    assert!((0.85..1.5).contains(&(stated / hidden)), "{hidden} of all skin is hidden, {stated} missing");
    assert!(skin.quality.doubts.contains(&Doubt::Coverage), "{:?}", skin.quality.doubts);
}

/// He stands out on one side as a mask would, but back on the other.
#[test]
fn a_patient_who_moved_wears_no_mask() {
    let phantom = Phantom::new(options()).expect("the options are in range");
    let mut volume = phantom.volume();
    let still = volume.hu.clone();
    for ((z, y, x), v) in volume.hu.indexed_iter_mut() {
        if z > 45 {
            *v = still[[z, y.saturating_sub(2), x]];
        }
    }
    let skin = reconstruct(&volume, 1.0, &QualityLimits::default(), &Silent).expect("a head");
    assert!(skin.quality.doubts.contains(&Doubt::Motion), "{:?}", skin.quality.doubts);
    assert!(
        skin.quality.missing.iter().all(|m| m.reason != StretchReason::Covered),
        "{:?}",
        skin.quality.missing
    );
}
