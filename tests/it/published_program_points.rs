//! `paper`'s points are the published program's, once that program's frame is undone.

use triplanar::cloud::PointCloud;
use triplanar::dicom::Volume;
use triplanar::geometry::Plane;
use triplanar::observer::Silent;
use triplanar::pipeline::Parameters;
use triplanar::pipeline::paper::decisions::decide;
use triplanar::pipeline::paper::lift::lift;

use crate::support::published::Published;
use crate::support::{data, instances};

/// mm
const TOLERANCE: f64 = 1e-3;

/// Series whose scan axes are the patient's: the program knows no others.
const STANDARD: [&str; 2] = ["phantom_4", "imagex_siemens_phantom_2mm"];

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn raw_points_are_the_published_programs_in_patient_coordinates() {
    let data = data::dir();
    for name in STANDARD {
        let volume = instances::volume(&data, name);
        let decisions = decide(&volume.hu, &Parameters::paper(), &Silent).expect("nobody cancels");
        let published = Published::of(&data, name);
        for (plane, cloud) in Plane::ALL.into_iter().zip(lift(&decisions, &volume.grid)) {
            let theirs = published.points(&format!("raw_{}", plane.name()));
            check(name, plane, ours(&volume, plane, &cloud), theirs);
        }
    }
}

/// Our points in the program's frame, with the cut that it makes: x from the first column, y from
/// the last row to anterior, z from the top down. Its sagittal and coronal points lie one slice too
/// low, and it takes the number of slices for the volume's height in mm.
fn ours(volume: &Volume, plane: Plane, cloud: &PointCloud) -> Vec<[f64; 3]> {
    let grid = &volume.grid;
    let origin = grid.lps([0, 0, 0]);
    let (shift, bottom) = match plane {
        Plane::Axial => (0.0, f64::INFINITY),
        Plane::Sagittal | Plane::Coronal => (-grid.step()[0][2], grid.shape()[0] as f64),
    };
    let in_frame = |p: &[f32; 3]| {
        let [x, y, z] = p.map(f64::from);
        [x - origin[0], origin[1] - y, origin[2] - z + shift]
    };
    cloud.points.iter().map(in_frame).filter(|p| p[2] <= bottom + TOLERANCE).collect()
}

fn check(name: &str, plane: Plane, mut ours: Vec<[f64; 3]>, theirs: Vec<[f32; 3]>) {
    let mut theirs: Vec<[f64; 3]> = theirs.into_iter().map(|p| p.map(f64::from)).collect();
    assert_eq!(ours.len(), theirs.len(), "{name} {plane:?}: number of raw points");
    // Points are at least a pixel apart: in this order both lists correspond one to one.
    let key = |p: &[f64; 3]| p.map(|v| (v * 20.0).round() as i64);
    ours.sort_by_key(key);
    theirs.sort_by_key(key);
    for (our, their) in ours.iter().zip(&theirs) {
        let off = (0..3).map(|axis| (our[axis] - their[axis]).abs()).fold(0.0, f64::max);
        assert!(off <= TOLERANCE, "{name} {plane:?}: {our:?}, theirs {their:?}");
    }
}
