//! The profile `precise` puts the skin in the same place however a head is scanned.

use triplanar::cloud::PointCloud;
use triplanar::cloud::ply::decode;
use triplanar::dicom::series::ReadLimits;
use triplanar::geometry::Plane;
use triplanar::observer::Silent;
use triplanar::phantom::{Acquisition, Options, Order, PatientPosition, Phantom};
use triplanar::pipeline::Parameters;
use triplanar::reconstruction::run;

use crate::support::instances::InMemory;

fn head() -> Options {
    Options { noise_hu: 6.0, pitch_deg: -5.0, roll_deg: 3.0, yaw_deg: 6.0, ..Options::default() }
}

fn cloud(files: Vec<Vec<u8>>) -> PointCloud {
    let product =
        run(&InMemory(files), &Parameters::precise(), &ReadLimits::default(), &Silent).expect("a cloud");
    decode(&product.clouds[0].1).expect("our own PLY").0
}

fn files(phantom: &Phantom) -> Vec<Vec<u8>> {
    phantom.instances().into_iter().map(|(_, bytes)| bytes).collect()
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// Signed distances to the known skin, mm; all points count.
fn errors(phantom: &Phantom, cloud: &PointCloud) -> Vec<f64> {
    cloud.points.iter().map(|p| phantom.signed_distance(p.map(f64::from))).collect()
}

/// Of each point of one cloud, the distance from its nearest neighbour in the other along that
/// one's normal, mm.
fn apart(cloud: &PointCloud, other: &PointCloud) -> Vec<f64> {
    let cell = |p: &[f32; 3]| p.map(|v| v.div_euclid(2.0) as i32);
    let mut cells: std::collections::HashMap<[i32; 3], Vec<usize>> = std::collections::HashMap::new();
    for (i, p) in other.points.iter().enumerate() {
        cells.entry(cell(p)).or_default().push(i);
    }
    let nearest = |p: &[f32; 3]| {
        let middle = cell(p);
        let around = (0..27).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1]);
        let near = around.filter_map(|d| cells.get(&[0, 1, 2].map(|a| middle[a] + d[a]))).flatten();
        let squared = |i: &usize| (0..3).map(|a| (p[a] - other.points[*i][a]).powi(2)).sum::<f32>();
        near.min_by(|i, j| squared(i).total_cmp(&squared(j))).copied()
    };
    let along = |p: &[f32; 3]| {
        nearest(p).map(|i| {
            let (q, n) = (other.points[i], other.normals[i]);
            f64::from((0..3).map(|a| (p[a] - q[a]) * n[a]).sum::<f32>())
        })
    };
    cloud.points.iter().filter_map(along).collect()
}

#[test]
fn every_way_to_acquire_a_head_gives_the_same_skin() {
    let phantom = Phantom::new(head()).expect("valid options");
    let expected = cloud(files(&phantom));
    let acquisitions = [
        ("sagittal", Plane::Sagittal, PatientPosition::Hfs, Order::Ascending),
        ("coronal, feet first, prone", Plane::Coronal, PatientPosition::Ffp, Order::Descending),
        ("feet first", Plane::Axial, PatientPosition::Ffs, Order::Ascending),
        ("prone", Plane::Axial, PatientPosition::Hfp, Order::Ascending),
        ("descending", Plane::Axial, PatientPosition::Hfs, Order::Descending),
    ];
    let mut copies = Vec::new();
    for (what, plane, position, order) in acquisitions {
        let copy = phantom.acquired_as(Acquisition { plane, position, order }).expect("valid options");
        copies.push((what, cloud(files(&copy))));
    }
    copies.push(("Enhanced CT", cloud(vec![phantom.enhanced_instance().1])));
    for (what, copy) in &copies {
        let distances = apart(copy, &expected);
        let alone = copy.len() - distances.len();
        assert!(alone * 200 <= copy.len(), "{what}: {alone} points of {} without a neighbour", copy.len());
        let rms = rms(&distances);
        assert!(rms <= 0.05, "{what}: {rms:.4} mm apart");
        let true_rms = self::rms(&errors(&phantom, copy));
        assert!(true_rms <= 0.06, "{what}: {true_rms:.4} mm from the known skin");
    }
}

#[test]
fn a_tilted_gantry_costs_no_accuracy() {
    for tilt_deg in [-18.0, 15.0] {
        let options = Options { slices: 330, slice_mm: 0.625, top_mm: 110.0, tilt_deg, ..head() };
        let phantom = Phantom::new(options).expect("valid options");
        let errors = errors(&phantom, &cloud(files(&phantom)));
        let (rms, bias) = (rms(&errors), errors.iter().sum::<f64>() / errors.len() as f64);
        assert!(rms <= 0.09, "tilt {tilt_deg}: rms {rms:.4} mm");
        assert!(bias.abs() <= 0.0225, "tilt {tilt_deg}: bias {bias:.4} mm");
    }
}
