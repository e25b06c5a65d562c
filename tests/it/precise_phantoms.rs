//! The whole profile on phantoms whose skin is known.

mod on_the_skin;

use ndarray::{Array3, Slice};

use triplanar::dicom::Volume;
use triplanar::geometry::{Axis, Grid, Plane, Vec3, add, dot, norm, scale, sub};
use triplanar::observer::Silent;
use triplanar::phantom::{Acquisition, Options, Phantom};
use triplanar::pipeline::precise::{
    Doubt, NoSkin, QualityLimits, Skin, SliceContour, StretchReason, Verdict, reconstruct,
};

/// A scan that is quick to make and to read: 0.9 mm pixels, 2 mm slices.
fn options() -> Options {
    Options {
        columns: 256,
        rows: 256,
        column_mm: 0.9,
        row_mm: 0.9,
        slices: 90,
        slice_mm: 2.0,
        ..Options::default()
    }
}

fn run(options: Options, leaf: f64) -> (Phantom, Result<Skin, NoSkin>) {
    let phantom = Phantom::new(options).expect("the options are in range");
    let skin = reconstruct(&phantom.volume(), leaf, &QualityLimits::default(), &Silent);
    (phantom, skin)
}

fn errors(phantom: &Phantom, skin: &Skin) -> Vec<f64> {
    skin.points.iter().map(|p| phantom.signed_distance(p.place.map(f64::from))).collect()
}

fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}

/// Whether a point of the cloud lies so near to a place, mm.
fn has_point(skin: &Skin, place: Vec3, mm: f64) -> bool {
    let squared = |p: [f32; 3]| (0..3).map(|a| (f64::from(p[a]) - place[a]).powi(2)).sum::<f64>();
    skin.points.iter().any(|p| squared(p.place) < mm * mm)
}

fn distance(a: Vec3, b: Vec3) -> f64 {
    norm(sub(a, b))
}

/// Then the scan shows no air, and what fills the square could be taken for it.
#[test]
fn a_scan_circle_within_the_head_is_no_skin() {
    const RADIUS_MM: f64 = 60.0;
    for fill in [-1024, -1000] {
        let phantom = Phantom::new(options()).expect("the options are in range");
        let mut volume = phantom.volume();
        let from_middle = |i: usize| (i as f64 - 127.5) * 0.9;
        for ((_, y, x), v) in volume.hu.indexed_iter_mut() {
            if from_middle(y).hypot(from_middle(x)) > RADIUS_MM {
                *v = fill;
            }
        }
        let skin = reconstruct(&volume, 1.0, &QualityLimits::default(), &Silent).expect("a head");
        assert!(skin.quality.doubts.contains(&Doubt::CutAtSide), "{:?}", skin.quality.doubts);
        assert!(skin.quality.verdict != Verdict::Good);
        // Neither along the circle nor on the walls of the cavities that it lays open.
        let errors = errors(&phantom, &skin);
        let invented = errors.iter().filter(|e| e.abs() > 3.0).count();
        assert!(invented * 1000 < errors.len(), "{invented} of {} points are no skin", errors.len());
    }
}

/// The straight way from contour to contour would cut off what is curved, and one slice alone does not
/// tell where between it and the next the skin is.
#[test]
fn between_thick_slices_the_vertex_is_in_its_true_place() {
    let (phantom, skin) = run(Options { slices: 60, slice_mm: 3.0, ..options() }, 1.0);
    let skin = skin.expect("a head");
    let errors: Vec<f64> = errors(&phantom, &skin)
        .into_iter()
        .zip(&skin.points)
        .filter(|(e, p)| p.normal[2] > 0.9 && e.abs() < 3.0)
        .map(|(e, _)| e)
        .collect();
    let bias = errors.iter().sum::<f64>() / errors.len() as f64;
    assert!(errors.len() > 1000, "only {} points", errors.len());
    assert!(bias.abs() < 0.06, "bias {bias} mm");
    assert!(rms(&errors) < 0.15, "rms {} mm", rms(&errors));
}

#[test]
fn the_skin_lies_in_its_true_place() {
    let (phantom, skin) = run(options(), 1.0);
    let skin = skin.expect("a head");
    let errors = errors(&phantom, &skin);
    let near: Vec<f64> = errors.iter().copied().filter(|e| e.abs() < 3.0).collect();
    let (stray, bias) =
        (1.0 - near.len() as f64 / errors.len() as f64, near.iter().sum::<f64>() / near.len() as f64);
    assert!(stray < 0.002, "{stray} of the points are no skin");
    assert!(rms(&near) < 0.15, "rms {} mm", rms(&near));
    assert!(bias.abs() < 0.03, "bias {bias} mm");
    let covered = |reason| reason == StretchReason::Covered;
    assert!(!skin.quality.missing.iter().any(|m| covered(m.reason)), "{:?}", skin.quality.missing);
    let truth = phantom.skin_points(3.0);
    let covered = truth.iter().filter(|p| has_point(&skin, **p, 1.0)).count();
    assert!(
        covered * 100 >= truth.len() * 95,
        "only {covered} of {} spots of skin have a point",
        truth.len()
    );
}

/// In a sagittal series that was reformatted from thick axial slices the skin between these is found as well.
#[test]
fn the_same_voxels_in_sagittal_images_give_the_same_skin() {
    let reformatted = Acquisition { plane: Plane::Sagittal, ..Acquisition::default() };
    let clouds = [Acquisition::default(), reformatted].map(|acquisition| {
        let (_, skin) = run(Options { acquisition, yaw_deg: 9.0, ..options() }, 1.0);
        skin.expect("a head")
    });
    let [axial, sagittal] = &clouds;
    assert_eq!(axial.points.len(), sagittal.points.len());
    assert!((axial.quality.coverage - sagittal.quality.coverage).abs() < 1e-6);
    for (a, s) in axial.points.iter().zip(&sagittal.points) {
        let apart = distance(a.place.map(f64::from), s.place.map(f64::from));
        assert!(apart < 0.001, "{a:?} and {s:?} are {apart} mm apart");
    }
}

/// Slices that hold one value were added above and below; the scan cuts the neck.
#[test]
fn empty_slices_at_the_ends_change_nothing() {
    let phantom = Phantom::new(options()).expect("the options are in range");
    let volume = phantom.volume();
    let skin =
        |volume: &Volume| reconstruct(volume, 1.0, &QualityLimits::default(), &Silent).expect("a head");
    let alone = skin(&volume);
    let rows = |skin: &Skin, before: usize| -> Vec<(Plane, usize, f64)> {
        let index = |s: &SliceContour| s.index - if s.plane == Plane::Axial { before } else { 0 };
        skin.slices.iter().map(|s| (s.plane, index(s), s.accepted_mm)).collect()
    };
    for fill in [-1000, -1024, -2000] {
        let (above, below) = (5, 9);
        let [nz, ny, nx] = volume.grid.shape();
        let mut hu = Array3::from_elem([above + nz + below, ny, nx], fill);
        hu.slice_axis_mut(ndarray::Axis(0), Slice::from(above..above + nz)).assign(&volume.hu);
        let (first, step) = (volume.grid.slice_origins()[0], volume.grid.step()[0]);
        let origin = |k: usize| add(first, scale(step, k as f64 - above as f64));
        let origins = (0..above + nz + below).map(origin).collect();
        let grid = Grid::new(Axis::Z, origins, *volume.grid.step(), [above + nz + below, ny, nx]);
        let padded = skin(&Volume { hu, grid, ..volume.clone() });
        assert_eq!(padded.points.len(), alone.points.len(), "with {fill}");
        for (p, q) in padded.points.iter().zip(&alone.points) {
            let apart = distance(p.place.map(f64::from), q.place.map(f64::from));
            assert!(apart < 1e-3, "{q:?} has moved by {apart} mm with {fill}");
        }
        assert_eq!(rows(&padded, above), rows(&alone, 0), "with {fill}");
    }
}

/// Where slices lie 4 mm apart the vertex shows in one of them alone.
#[test]
fn what_no_two_slices_show_is_rejected_with_its_reason() {
    let (_, skin) = run(Options { slices: 46, slice_mm: 4.0, ..options() }, 1.0);
    let skin = skin.expect("a head");
    let unresolved = |reason| reason == StretchReason::Unresolved;
    let missing: f64 = skin.quality.missing.iter().filter(|m| unresolved(m.reason)).map(|m| m.area_cm2).sum();
    assert!((1.0..60.0).contains(&missing), "{:?}", skin.quality.missing);
    let stretches: Vec<_> = skin
        .slices
        .iter()
        .flat_map(|slice| slice.rejected.iter().map(move |stretch| (slice.plane, stretch)))
        .filter(|(_, stretch)| unresolved(stretch.reason))
        .collect();
    for plane in [Plane::Sagittal, Plane::Coronal] {
        assert!(stretches.iter().any(|s| s.0 == plane), "no {plane:?} slice tells it");
    }
    assert!(stretches.iter().all(|(_, s)| s.measured > s.limit && s.limit > 0.0), "{stretches:?}");
}

/// Air without noise has one value, as what lies outside the field of view.
#[test]
fn a_scan_without_noise_is_not_taken_for_one_that_was_filled() {
    let (_, skin) = run(Options { noise_hu: 0.0, ..options() }, 1.0);
    let quality = skin.expect("a head").quality;
    assert_eq!((quality.cut_at_side_cm2, quality.cut_above_cm2), (0.0, 0.0));
    assert!(!quality.missing.iter().any(|m| m.reason == StretchReason::FieldOfView), "{:?}", quality.missing);
}

/// Archives set the air to one value, and the foot of every edge with it.
#[test]
fn clipped_air_is_told_and_moves_no_skin() {
    for value in [-1000, -1024] {
        let phantom = Phantom::new(options()).expect("the options are in range");
        let mut volume = phantom.volume();
        volume.hu.mapv_inplace(|v| if v < -900 { value } else { v });
        let skin = reconstruct(&volume, 1.0, &QualityLimits::default(), &Silent).expect("a head");
        assert!(skin.quality.doubts.contains(&Doubt::ClippedAir), "{:?}", skin.quality.doubts);
        assert!((skin.quality.noise_hu / options().noise_hu - 1.0).abs() < 0.25, "{}", skin.quality.noise_hu);
        let near: Vec<f64> = errors(&phantom, &skin).into_iter().filter(|e| e.abs() < 3.0).collect();
        let bias = near.iter().sum::<f64>() / near.len() as f64;
        assert!(bias.abs() < 0.03, "bias {bias} mm with air at {value} HU");
    }
    let (_, plain) = run(options(), 1.0);
    assert!(!plain.expect("a head").quality.clipped_air);
}

/// A soft kernel's edge reaches further than three voxels.
#[test]
fn a_wide_edge_is_measured_whole() {
    let soft = Options { column_mm: 0.6, row_mm: 0.6, columns: 384, rows: 384, blur_mm: 1.0, ..options() };
    let (phantom, skin) = run(soft, 1.0);
    let skin = skin.expect("a head");
    let width = skin.quality.edge_in_plane_mm;
    assert!((0.88..1.1).contains(&width), "an edge of 1 mm is seen as {width} mm wide");
    let near: Vec<f64> = errors(&phantom, &skin).into_iter().filter(|e| e.abs() < 3.0).collect();
    let bias = near.iter().sum::<f64>() / near.len() as f64;
    assert!(bias.abs() < 0.03, "bias {bias} mm");
}

/// The air between skin and border is too narrow there for the ball that looks for the outside.
#[test]
fn skin_next_to_the_border_of_the_image_is_found() {
    let phantom = Phantom::new(options()).expect("the options are in range");
    let truth = phantom.skin_points(3.0);
    let front = truth.iter().map(|t| t[1]).fold(f64::MAX, f64::min);
    let half = options().row_mm * (options().rows - 1) as f64 / 2.0;
    let (_, skin) = run(Options { centre_mm: [0.0, front - 2.0 + half], ..options() }, 1.0);
    let skin = skin.expect("a head");
    let tip: Vec<_> = truth.iter().filter(|t| t[1] < front + 4.0).collect();
    let near =
        |t: &[f64; 3], p: [f32; 3]| (0..3).map(|a| (f64::from(p[a]) - t[a]).powi(2)).sum::<f64>() < 1.5 * 1.5;
    let found = tip.iter().filter(|t| skin.points.iter().any(|p| near(t, p.place))).count();
    assert!(!tip.is_empty() && found * 100 >= tip.len() * 95, "{found} of {} spots of skin", tip.len());
}

#[test]
fn normals_point_outward_and_the_stated_error_is_honest() {
    let (phantom, skin) = run(Options { yaw_deg: 10.0, pitch_deg: -8.0, ..options() }, 1.0);
    let skin = skin.expect("a head");
    let mut cosines: Vec<f64> = skin
        .points
        .iter()
        .map(|p| dot(p.normal.map(f64::from), phantom.normal(p.place.map(f64::from))))
        .collect();
    cosines.sort_by(|a, b| b.total_cmp(a));
    for (percent, degrees) in [(50, 1.0_f64), (97, 8.0)] {
        let angle = cosines[cosines.len() * percent / 100].clamp(-1.0, 1.0).acos().to_degrees();
        assert!(angle < degrees, "{percent} % of the normals are up to {angle} degrees off");
    }
    let mut stated: Vec<(f64, f64)> = skin
        .points
        .iter()
        .map(|p| (f64::from(p.error), phantom.signed_distance(p.place.map(f64::from))))
        // Where two slices leave the vertex open one phantom tells little: the skin is anywhere between.
        .filter(|e| e.1.abs() < 3.0 && e.0 < 0.3)
        .collect();
    stated.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = stated.len() / 2;
    let (sure, unsure) = stated.split_at(half);
    let true_rms = |part: &[(f64, f64)]| rms(&part.iter().map(|e| e.1).collect::<Vec<f64>>());
    let said = |part: &[(f64, f64)]| rms(&part.iter().map(|e| e.0).collect::<Vec<f64>>());
    for part in [sure, unsure] {
        let ratio = true_rms(part) / said(part);
        assert!((0.5..2.0).contains(&ratio), "true error is {ratio} times the stated one");
    }
    assert!(true_rms(sure) < true_rms(unsure), "surer points are no better");
}

#[test]
fn a_tilted_gantry_changes_nothing_but_the_slices() {
    let (phantom, skin) = run(Options { tilt_deg: 15.0, slices: 110, top_mm: 100.0, ..options() }, 1.0);
    let errors = errors(&phantom, &skin.expect("a head"));
    let near: Vec<f64> = errors.iter().copied().filter(|e| e.abs() < 3.0).collect();
    assert!(rms(&near) < 0.2, "rms {} mm", rms(&near));
}

#[test]
fn the_same_on_any_number_of_threads() {
    let phantom = Phantom::new(options()).expect("the options are in range");
    let volume = phantom.volume();
    let [one, four] = [1, 4].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| reconstruct(&volume, 1.0, &QualityLimits::default(), &Silent)).expect("a head")
    });
    assert_eq!(one.points, four.points);
    assert_eq!(one.quality, four.quality);
    assert_eq!(one.slices, four.slices);
}

/// A board that runs along the whole scan and is cut out round the head, with air between them: where
/// the head fills the board's cross-section it is the head all the same.
#[test]
fn a_head_that_reaches_through_a_board_keeps_its_skin() {
    let phantom = Phantom::new(options()).expect("the options are in range");
    let truth = phantom.skin_points(3.0);
    let back = truth.iter().map(|t| t[1]).fold(f64::MIN, f64::max);
    let board = back - 30.0..back - 26.0;
    let mut volume = phantom.volume();
    for ((z, y, x), hu) in volume.hu.indexed_iter_mut() {
        let p = volume.grid.lps([z, y, x]);
        if board.contains(&p[1]) && phantom.signed_distance(p) > 2.0 {
            *hu = 60;
        }
    }
    let skin = reconstruct(&volume, 1.0, &QualityLimits::default(), &Silent).expect("a head");
    let near =
        |t: &[f64; 3], p: [f32; 3]| (0..3).map(|a| (f64::from(p[a]) - t[a]).powi(2)).sum::<f64>() < 1.5 * 1.5;
    let at_board: Vec<_> = truth.iter().filter(|t| board.contains(&t[1])).collect();
    let found = at_board.iter().filter(|t| skin.points.iter().any(|p| near(t, p.place))).count();
    let on_board = |p: &[f64; 3]| {
        p[1] > board.start - 1.0 && p[1] < board.end + 1.0 && phantom.signed_distance(*p) > 1.5
    };
    let stray = skin.points.iter().map(|p| p.place.map(f64::from)).filter(on_board).count();
    assert_eq!(stray, 0, "points on the board");
    assert!(found * 100 >= at_board.len() * 60, "{found} of {} spots of skin", at_board.len());
}

#[test]
fn a_neck_without_its_head_ends_with_a_reason() {
    let (_, skin) = run(Options { top_mm: -85.0, slices: 40, ..options() }, 1.0);
    let error = skin.expect_err("there is no head");
    assert!(matches!(error, NoSkin::NoHead { .. }), "{error}");
}

/// Its column of brain and neck goes through all slices, as a couch does.
#[test]
fn a_head_cut_above_its_middle_keeps_its_back() {
    let (phantom, skin) = run(Options { slices: 140, slice_mm: 1.25, top_mm: 30.0, ..options() }, 1.0);
    let skin = skin.expect("a head");
    assert!(skin.quality.doubts.contains(&Doubt::CutAbove), "{:?}", skin.quality.doubts);
    let in_view = 30.0 - 1.25 * 139.0..30.0;
    let seen = |p: &Vec3| (in_view.start + 3.0..in_view.end - 3.0).contains(&p[2]);
    let spots: Vec<Vec3> = phantom.skin_points(3.0).into_iter().filter(seen).collect();
    let covered = spots.iter().filter(|p| has_point(&skin, **p, 1.5)).count();
    assert!(covered * 100 >= spots.len() * 95, "{covered} of {} spots have a point", spots.len());
}

#[test]
fn a_head_cut_by_the_first_slice_is_limited() {
    let (_, skin) = run(Options { top_mm: 50.0, slices: 75, ..options() }, 1.0);
    let quality = skin.expect("a head").quality;
    assert_eq!(quality.verdict, Verdict::Limited);
    assert!(quality.doubts.contains(&Doubt::CutAbove), "{:?}", quality.doubts);
}

/// A scanner's field of view is a circle; here one that cuts 6 mm off the nose.
#[test]
fn what_the_field_of_view_cuts_is_no_skin_and_the_head_is_limited() {
    let phantom = Phantom::new(options()).expect("the options are in range");
    let truth = phantom.skin_points(3.0);
    let front = truth.iter().map(|t| t[1]).fold(f64::MAX, f64::min);
    for fill in [-1024, -2000] {
        let mut volume = phantom.volume();
        for ((z, y, x), hu) in volume.hu.indexed_iter_mut() {
            let p = volume.grid.lps([z, y, x]);
            if p[0].hypot(p[1]) > -front - 6.0 {
                *hu = fill;
            }
        }
        let skin = reconstruct(&volume, 1.0, &QualityLimits::default(), &Silent).expect("a head");
        let quality = &skin.quality;
        assert_eq!(quality.verdict, Verdict::Limited);
        assert!(quality.doubts.contains(&Doubt::CutAtSide), "{:?}", quality.doubts);
        let stray = errors(&phantom, &skin).into_iter().filter(|e| *e < -2.0).count();
        assert_eq!(stray, 0, "points where the field of view ends, filled with {fill}");
        let missing = quality.missing.iter().filter(|m| m.reason == StretchReason::FieldOfView);
        assert!(missing.map(|m| m.area_cm2).sum::<f64>() > 3.0, "{:?}", quality.missing);
    }
}

/// Sagittal images whose first one cuts an ear off; the rest of the head is in view.
#[test]
fn the_first_of_sagittal_images_can_cut_the_head_at_its_side() {
    let options = Options { slices: 190, slice_mm: 0.9, ..options() };
    let phantom = Phantom::new(options).expect("the options are in range");
    let volume = phantom.volume();
    let doubts = |first: usize| {
        let part = Slice::from(first..);
        let hu = volume.hu.slice_axis(ndarray::Axis(2), part).as_standard_layout().into_owned();
        let shape = [hu.shape()[0], hu.shape()[1], hu.shape()[2]];
        let sagittal = volume.grid.sliced_along(Axis::X).expect("upright and even");
        let origins = sagittal.slice_origins()[first..].to_vec();
        let grid = Grid::new(Axis::X, origins, *sagittal.step(), shape);
        let skin =
            reconstruct(&Volume { hu, grid, ..volume.clone() }, 1.0, &QualityLimits::default(), &Silent);
        skin.expect("a head").quality.doubts
    };
    assert!(!doubts(0).contains(&Doubt::CutAtSide), "all of it is in view");
    let right = phantom.skin_points(3.0).iter().map(|p| p[0]).fold(f64::MAX, f64::min);
    let cut = ((right + 15.0 - volume.grid.lps([0, 0, 0])[0]) / 0.9) as usize;
    assert!(doubts(cut).contains(&Doubt::CutAtSide));
}

/// The head lies on a board that is wider than the field of view.
#[test]
fn where_the_field_of_view_cuts_a_board_no_skin_is_missing() {
    let phantom = Phantom::new(options()).expect("the options are in range");
    let truth = phantom.skin_points(3.0);
    let back = truth.iter().map(|t| t[1]).fold(f64::MIN, f64::max);
    let furthest = truth.iter().map(|t| t[0].hypot(t[1])).fold(0.0, f64::max);
    let mut volume = phantom.volume();
    for ((z, y, x), hu) in volume.hu.indexed_iter_mut() {
        let p = volume.grid.lps([z, y, x]);
        if p[0].hypot(p[1]) > furthest + 6.0 {
            *hu = -2000;
        } else if (back - 2.0..back + 4.0).contains(&p[1]) && phantom.signed_distance(p) > 0.0 {
            *hu = 60;
        }
    }
    let skin = reconstruct(&volume, 1.0, &QualityLimits::default(), &Silent).expect("a head");
    let missing = &skin.quality.missing;
    assert!(missing.iter().any(|m| m.reason == StretchReason::Touching), "{missing:?}");
    assert!(!missing.iter().any(|m| m.reason == StretchReason::FieldOfView), "{missing:?}");
    let reasons: Vec<_> =
        skin.slices.iter().flat_map(|slice| slice.rejected.iter().map(|stretch| stretch.reason)).collect();
    assert!(reasons.contains(&StretchReason::Foreign));
}

#[test]
fn each_plane_has_its_own_cloud_and_every_slice_its_row() {
    let (_, skin) = run(options(), 2.0);
    let skin = skin.expect("a head");
    for plane in Plane::ALL {
        assert!(skin.in_plane(plane).len() * 2 > skin.points.len(), "{plane:?}");
        let rows = skin.slices.iter().filter(|s| s.plane == plane && s.accepted_mm > 100.0).count();
        assert!(rows > 50, "{plane:?} has {rows} rows");
    }
}
