//! True place: however a head is scanned, its cloud lies in the same place in the patient.

use triplanar::cloud::PointCloud;
use triplanar::cloud::ply::decode;
use triplanar::dicom::series::ReadLimits;
use triplanar::geometry::Plane;
use triplanar::phantom::{Acquisition, Options, Order, PatientPosition, Phantom};
use triplanar::pipeline::{Parameters, Silent};
use triplanar::reconstruction::run;

use crate::support::instances::InMemory;
use crate::support::skin::score;

/// No voxel lies on the border of a 1 mm cell, so that rounding decides nothing.
fn head() -> Options {
    Options {
        slices: 36,
        slice_mm: 3.0,
        top_mm: 84.03,
        centre_mm: [0.11, -5.07],
        noise_hu: 4.0,
        roll_deg: 3.0,
        ..Options::default()
    }
}

fn cloud(files: Vec<Vec<u8>>) -> PointCloud {
    let mut parameters = Parameters::default();
    // Slices are too far apart for as many neighbours as the published filter wants.
    parameters.radius_outlier.min_neighbours = 60;
    let product = run(&InMemory(files), &parameters, &ReadLimits::default(), &Silent).expect("a cloud");
    decode(&product.clouds[0].1).expect("our own PLY").0
}

fn files(options: Options) -> Vec<Vec<u8>> {
    let phantom = Phantom::new(options).expect("valid options");
    phantom.instances().into_iter().map(|(_, bytes)| bytes).collect()
}

#[test]
fn sagittal_coronal_feet_first_prone_descending_and_enhanced_copies_give_the_same_cloud() {
    let expected = cloud(files(head()));
    assert!(expected.len() > 10_000, "only {} points", expected.len());
    let acquisitions = [
        ("sagittal", Plane::Sagittal, PatientPosition::Hfs, Order::Ascending),
        ("coronal, feet first", Plane::Coronal, PatientPosition::Ffs, Order::Ascending),
        ("feet first", Plane::Axial, PatientPosition::Ffs, Order::Ascending),
        ("prone", Plane::Axial, PatientPosition::Hfp, Order::Ascending),
        ("feet first, prone", Plane::Axial, PatientPosition::Ffp, Order::Ascending),
        ("descending", Plane::Axial, PatientPosition::Hfs, Order::Descending),
    ];
    for (what, plane, position, order) in acquisitions {
        let acquisition = Acquisition { plane, position, order };
        assert_same(what, &expected, &cloud(files(Options { acquisition, ..head() })));
    }
    let enhanced = Phantom::new(head()).expect("valid options").enhanced_instance().1;
    assert_same("Enhanced CT", &expected, &cloud(vec![enhanced]));
}

fn assert_same(what: &str, expected: &PointCloud, cloud: &PointCloud) {
    assert_eq!(cloud.len(), expected.len(), "{what}: number of points");
    let farthest = cloud.points.iter().zip(&expected.points).map(|(a, b)| {
        let offset: [f32; 3] = std::array::from_fn(|i| (a[i] - b[i]).abs());
        offset.into_iter().fold(0.0, f32::max)
    });
    let farthest = farthest.fold(0.0, f32::max);
    assert!(farthest <= 1e-3, "{what}: a point is {farthest} mm from its place");
    assert_eq!(cloud.planes, expected.planes, "{what}: planes of origin");
    assert_eq!(cloud.unique, expected.unique, "{what}: unique points");
}

#[test]
fn a_gantry_tilted_scan_lies_on_the_same_skin_as_the_untilted_one() {
    let options = Options { slices: 80, slice_mm: 1.5, noise_hu: 4.0, ..Options::default() };
    let straight = Phantom::new(options.clone()).expect("valid options");
    let upright = score(&straight, &cloud(files(options.clone())));
    for tilt_deg in [-15.0, 12.0] {
        let tilted = score(&straight, &cloud(files(Options { tilt_deg, ..options.clone() })));
        eprintln!("tilt {tilt_deg}°: {tilted:.3?}; untilted: {upright:.3?}");
        assert!((tilted.bias - upright.bias).abs() <= 0.1, "tilt {tilt_deg}°: bias {} mm", tilted.bias);
        for (axis, name) in ["left–right", "front–back", "up–down"].into_iter().enumerate() {
            let off = tilted.shift[axis] - upright.shift[axis];
            assert!(off.abs() <= 0.1, "tilt {tilt_deg}°: shifted by {off:.3} mm {name}");
        }
    }
}
