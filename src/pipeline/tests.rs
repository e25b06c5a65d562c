//! The whole pipeline on an ellipsoid whose surface is known.

use std::collections::HashSet;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use ndarray::Array3;

use crate::dicom::{SeriesIdentity, Volume};
use crate::geometry::{Axis, Grid, Plane};
use crate::observer::{Observer, Silent, Stage};
use crate::pipeline::precise::{BorderPoint, StretchReason};
use crate::pipeline::{Parameters, PipelineError, Reason, border_picture, legend, picture, reconstruct};

/// Half axes of the ellipsoid, mm (voxels are cubes of 1 mm), and its centre in LPS mm.
const HALF: [f64; 3] = [60.0, 80.0, 40.0];
const CENTRE: [f64; 3] = [10.0, -20.0, 300.0];
const SHAPE: [usize; 3] = [130, 400, 400];

fn volume(hu_inside: i16) -> Volume {
    let middle = SHAPE.map(|n| n as f64 / 2.0);
    let hu = Array3::from_shape_fn(SHAPE, |(z, y, x)| {
        let [dz, dy, dx] = [z as f64 - middle[0], y as f64 - middle[1], x as f64 - middle[2]];
        let r = (dx / HALF[0]).powi(2) + (dy / HALF[1]).powi(2) + (dz / HALF[2]).powi(2);
        if r <= 1.0 { hu_inside } else { -1000 }
    });
    let corner = [CENTRE[0] - middle[2], CENTRE[1] + middle[1], CENTRE[2] + middle[0]];
    let origins = (0..SHAPE[0]).map(|z| [corner[0], corner[1], corner[2] - z as f64]).collect();
    let step = [[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]];
    Volume {
        hu,
        grid: Grid::new(Axis::Z, origins, step, SHAPE),
        sop_instance_uids: Vec::new(),
        doubtful_slices: Vec::new(),
        identity: SeriesIdentity {
            study_instance_uid: None,
            series_instance_uid: "2.25.1".parse().expect("a UID"),
            frame_of_reference_uid: None,
        },
    }
}

#[test]
fn the_points_of_every_plane_lie_on_the_surface_in_the_patient() {
    let result = reconstruct(&volume(40), &Parameters::paper(), &Silent).expect("an ellipsoid");
    assert_eq!(result.slices.len(), SHAPE.iter().sum::<usize>());
    for cloud in result.uniplanar.iter().chain([&result.triplanar]) {
        assert!(cloud.len() > 5_000, "{} points", cloud.len());
        for point in &cloud.points {
            let r: f64 = (0..3).map(|a| ((f64::from(point[a]) - CENTRE[a]) / HALF[a]).powi(2)).sum();
            // Border pixels lie up to a voxel's diagonal below the surface, 40 mm at its nearest.
            assert!((0.9..1.01).contains(&r.sqrt()), "{point:?}");
        }
    }
    let figures = &result.figures;
    assert_eq!(figures.after_statistical, result.triplanar.len() as u64);
    assert_eq!(figures.unique, result.triplanar.unique.iter().filter(|&&u| u).count() as u64);
    assert_eq!(figures.additional_over_axial, figures.merged as i64 - figures.downsampled[0] as i64);
    assert!(result.uniplanar[0].unique.iter().all(|&unique| !unique), "the axial cloud has itself");
}

#[test]
fn the_result_is_the_same_on_any_number_of_threads() {
    let volume = volume(40);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| reconstruct(&volume, &Parameters::paper(), &Silent)).expect("an ellipsoid")
    };
    let (one, three) = (run(1), run(3));
    assert_eq!(one.triplanar, three.triplanar);
    assert_eq!(one.uniplanar, three.uniplanar);
    assert_eq!(one.slices, three.slices);
    assert_eq!(one.figures, three.figures);
}

#[test]
fn a_volume_without_tissue_ends_as_empty_cloud_with_a_reason_for_every_slice() {
    let Err(PipelineError::EmptyCloud { stage, partial }) =
        reconstruct(&volume(-999), &Parameters::paper(), &Silent)
    else {
        panic!("air has no skin");
    };
    assert_eq!(stage, "the tests of the slices");
    assert_eq!(partial.slices.len(), SHAPE.iter().sum::<usize>());
    assert!(partial.slices.iter().all(|row| row.rejection.is_some_and(|r| r.reason == Reason::NoContour)));
    assert_eq!(partial.figures.raw, [0; 3]);
}

#[test]
fn without_an_accepted_axial_slice_there_is_no_box_and_so_no_point() {
    let mut parameters = Parameters::paper();
    parameters.thresholds.contour.axial_window_max = 150.0;
    let Err(PipelineError::EmptyCloud { partial, .. }) = reconstruct(&volume(40), &parameters, &Silent)
    else {
        panic!("the box is empty");
    };
    let accepted =
        |plane| partial.slices.iter().filter(|r| r.plane == plane && r.rejection.is_none()).count();
    assert_eq!(accepted(Plane::Axial), 0);
    assert!(accepted(Plane::Sagittal) > 0 && accepted(Plane::Coronal) > 0);
    let pixels = |plane| {
        let accepted = partial.slices.iter().filter(|r| r.plane == plane && r.rejection.is_none());
        accepted.map(|row| row.contour_points as u64).sum::<u64>()
    };
    assert_eq!(partial.figures.outside_axial_box, Plane::ALL.map(pixels), "none is dropped silently");
}

#[test]
fn a_filter_that_drops_every_point_is_named_and_the_figures_up_to_it_are_kept() {
    let mut parameters = Parameters::paper();
    parameters.radius_outlier.min_neighbours = 100_000;
    let Err(PipelineError::EmptyCloud { stage, partial }) = reconstruct(&volume(40), &parameters, &Silent)
    else {
        panic!("no point has so many neighbours");
    };
    assert_eq!(stage, "radius outlier removal");
    assert!(partial.figures.merged > 0 && partial.figures.after_radius == 0);
    assert!(!partial.uniplanar[0].is_empty());
}

/// Counts how often it is asked, and says stop from some time on.
struct Stopping {
    after: usize,
    asked: AtomicUsize,
    stages: Mutex<HashSet<Stage>>,
}

impl Observer for Stopping {
    fn progress(&self, stage: Stage, fraction: f64) {
        assert!((0.0..=1.0).contains(&fraction), "{stage:?} {fraction}");
        self.stages.lock().expect("no panic").insert(stage);
    }
    fn cancelled(&self) -> bool {
        self.asked.fetch_add(1, Ordering::Relaxed) >= self.after
    }
}

#[test]
fn it_asks_at_least_once_a_slice_whether_to_stop_and_then_stops() {
    let volume = volume(40);
    let watch = |after| Stopping { after, asked: AtomicUsize::new(0), stages: Mutex::default() };
    let patient = watch(usize::MAX);
    reconstruct(&volume, &Parameters::paper(), &patient).expect("an ellipsoid");
    let asked = patient.asked.into_inner();
    assert!(asked >= SHAPE.iter().sum(), "asked {asked} times");
    assert_eq!(patient.stages.into_inner().expect("no panic").len(), 5);

    for after in [0, 100, asked - 1] {
        let result = reconstruct(&volume, &Parameters::paper(), &watch(after));
        assert!(matches!(result, Err(PipelineError::Cancelled)), "after {after}");
    }
}

#[test]
fn a_picture_shows_the_contour_upright_in_its_colour() {
    let volume = volume(40);
    let parameters = Parameters::paper();
    let green = picture(&volume, &parameters, Plane::Sagittal, 200, true).expect("a slice");
    assert_eq!(green.dimensions(), (400, 130));
    // The top of the ellipsoid: 40 mm above the middle of the volume's 130 slices.
    assert_eq!(green.get_pixel(200, 25).0, [0, 255, 0]);
    assert_eq!(green.get_pixel(200, 24).0, [0, 0, 0]);
    let red = picture(&volume, &parameters, Plane::Sagittal, 200, false).expect("a slice");
    assert_eq!(red.get_pixel(200, 25).0, [255, 0, 0]);
    assert!(picture(&volume, &parameters, Plane::Axial, SHAPE[0], true).is_none());
}

#[test]
fn a_border_is_drawn_where_it_was_measured_and_pixels_are_square_in_mm() {
    let mut volume = volume(40);
    // Slices 3 mm apart, pixels of 1 mm: upright pictures are 3 times as high.
    let origins = (0..SHAPE[0]).map(|z| [0.0, 0.0, -3.0 * z as f64]).collect();
    volume.grid = Grid::new(Axis::Z, origins, [[0.0, 0.0, -3.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]], SHAPE);
    let at = |index, axis, reason| BorderPoint { index, axis, reason };
    let touching = Some(StretchReason::Touching);
    let border = [
        // Between two slices, above the middle of voxel 10 by a quarter of a slice.
        at([9.75, 100.0, 50.0], 0, None),
        // Between two columns, on the patient's left.
        at([20.0, 100.0, 300.6], 2, touching),
        // Across the sagittal slice: not in it, but in the axial and the coronal one.
        at([30.0, 120.0, 50.2], 2, None),
    ];
    let sagittal = border_picture(&volume, &border, Plane::Sagittal, 50).expect("a slice");
    assert_eq!(sagittal.dimensions(), (400, 390));
    let green: Vec<_> =
        sagittal.enumerate_pixels().filter(|p| p.2.0 == [0, 255, 0]).map(|p| (p.0, p.1)).collect();
    // 10.25 slices of 3 px from the top.
    assert_eq!(green, [(100, 30)]);
    let coronal = border_picture(&volume, &border, Plane::Coronal, 100).expect("a slice");
    assert_eq!(coronal.get_pixel(50, 30).0, [0, 255, 0]);
    for y in 60..63 {
        assert_eq!(coronal.get_pixel(301, y).0, [255, 150, 0], "as high as its voxel");
    }
    assert_ne!(coronal.get_pixel(301, 59).0, [255, 150, 0]);
    assert_ne!(coronal.get_pixel(301, 63).0, [255, 150, 0]);
    let axial = border_picture(&volume, &border, Plane::Axial, 30).expect("a slice");
    assert_eq!(axial.dimensions(), (400, 400));
    assert_eq!(axial.get_pixel(50, 400 - 1 - 120).0, [0, 255, 0]);
    assert!(legend().contains(&("touching", "orange")), "{:?}", legend());
}

#[test]
fn every_threshold_has_a_range() {
    let is_refused = |change: fn(&mut Parameters)| {
        let mut parameters = Parameters::paper();
        change(&mut parameters);
        parameters.check().is_err()
    };
    for profile in [Parameters::paper(), Parameters::precise()] {
        profile.check().expect("the defaults are within their ranges");
    }
    assert!(is_refused(|p| p.quality.coverage = 1.5), "a share above 1");
    assert!(is_refused(|p| p.quality.slice_mm = -1.0));
    assert!(is_refused(|p| p.quality.noise_hu = f64::NAN));
    assert!(is_refused(|p| p.unique_distance_mm = -1.0));
    assert!(is_refused(|p| p.thresholds.contour.min_area = f64::NAN));
    assert!(is_refused(|p| p.thresholds.solidity.min_solidity = 1.1));
    assert!(is_refused(|p| p.thresholds.four_direction.step = 0));
    assert!(is_refused(|p| p.thresholds.axial_intensity.window = 0));
}
