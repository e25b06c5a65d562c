//! True place: however a head is scanned, its cloud lies in the same place in the patient.

use triplanar::cloud::PointCloud;
use triplanar::cloud::ply::decode;
use triplanar::dicom::series::ReadLimits;
use triplanar::geometry::Plane;
use triplanar::observer::Silent;
use triplanar::phantom::{Acquisition, Options, Order, PatientPosition, Phantom};
use triplanar::pipeline::Parameters;
use triplanar::reconstruction::run;

use crate::support::instances::InMemory;
use crate::support::skin::score;

/// No voxel lies on the border of a 1 mm cell, so that rounding decides nothing.
fn head() -> Options {
    Options { top_mm: 84.03, centre_mm: [0.11, -5.07], noise_hu: 4.0, roll_deg: 3.0, ..Options::default() }
}

fn cloud(files: Vec<Vec<u8>>) -> PointCloud {
    let product =
        run(&InMemory(files), &Parameters::paper(), &ReadLimits::default(), &Silent).expect("a cloud");
    let cloud = decode(&product.clouds[0].1).expect("our own PLY").0;
    for plane in Plane::ALL {
        let share = cloud.planes.iter().filter(|planes| planes.contains(plane)).count() as f64;
        assert!(
            share / cloud.len() as f64 > 0.2,
            "hardly any {} points: this test sees little",
            plane.name()
        );
    }
    cloud
}

fn files(phantom: &Phantom) -> Vec<Vec<u8>> {
    phantom.instances().into_iter().map(|(_, bytes)| bytes).collect()
}

#[test]
fn sagittal_feet_first_prone_descending_and_enhanced_copies_give_the_same_cloud() {
    let phantom = Phantom::new(head()).expect("valid options");
    let expected = cloud(files(&phantom));
    let acquisitions = [
        ("sagittal", Plane::Sagittal, PatientPosition::Hfs, Order::Ascending),
        ("feet first", Plane::Axial, PatientPosition::Ffs, Order::Ascending),
        ("prone", Plane::Axial, PatientPosition::Hfp, Order::Ascending),
        ("descending", Plane::Axial, PatientPosition::Hfs, Order::Descending),
    ];
    for (what, plane, position, order) in acquisitions {
        let acquisition = Acquisition { plane, position, order };
        let copy = phantom.acquired_as(acquisition).expect("valid options");
        assert_same(what, &expected, &cloud(files(&copy)));
    }
    let acquisition =
        Acquisition { plane: Plane::Coronal, position: PatientPosition::Ffp, order: Order::Descending };
    let copy = phantom.acquired_as(acquisition).expect("valid options");
    let what = "Enhanced CT, coronal, feet first, prone, descending";
    assert_same(what, &expected, &cloud(vec![copy.enhanced_instance().1]));
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
    let options = Options { noise_hu: 4.0, ..Options::default() };
    let straight = Phantom::new(options.clone()).expect("valid options");
    let upright = score(&straight, &cloud(files(&straight)));
    let tilted = Phantom::new(Options { tilt_deg: -15.0, ..options }).expect("valid options");
    let tilted = score(&straight, &cloud(files(&tilted)));
    eprintln!("tilted: {tilted:.3?}; untilted: {upright:.3?}");
    assert!((tilted.bias - upright.bias).abs() <= 0.1, "bias {} mm", tilted.bias);
    for (axis, name) in ["left–right", "front–back", "up–down"].into_iter().enumerate() {
        let off = tilted.shift[axis] - upright.shift[axis];
        assert!(off.abs() <= 0.1, "shifted by {off:.3} mm {name}");
    }
}
