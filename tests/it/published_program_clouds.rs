//! Each stage of the cloud, fed with the published program's own raw points, gives what it gave.

use std::collections::HashMap;

use triplanar::cloud::PointCloud;
use triplanar::geometry::{Plane, PlaneSet};
use triplanar::observer::Silent;
use triplanar::pipeline::Parameters;
use triplanar::pipeline::neighbours::unique::unique;
use triplanar::pipeline::paper::voxel_grid::voxel_grid;
use triplanar::pipeline::paper::{radius_outlier, statistical_outlier};

use crate::support::data;
use crate::support::published::{Published, SERIES};

/// mm
const TOLERANCE: f32 = 1e-3;

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn every_stage_at_leaf_1_is_the_published_programs() {
    let data = data::dir();
    for name in SERIES {
        check(&Published::of(&data, name), name, "1");
    }
}

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn every_stage_at_leaf_0_38_is_the_published_programs() {
    let data = data::dir();
    check(&Published::of(&data, "phantom_4"), "phantom_4", "0.38");
}

fn check(published: &Published, name: &str, leaf: &str) {
    let parameters = Parameters { leaf_mm: leaf.parse().expect("a number"), ..Parameters::paper() };
    let expect = |stage: &str, points: &[[f32; 3]]| {
        let theirs = published.points(&format!("{stage}_leaf{leaf}"));
        same(&format!("{name} {stage} leaf {leaf}"), points, &theirs);
    };

    let uniplanar = Plane::ALL.map(|plane| {
        let raw = cloud(published.points(&format!("raw_{}", plane.name())), plane);
        let sampled = voxel_grid(&raw, parameters.leaf_mm);
        expect(&format!("voxel_{}", plane.name()), &sampled.points);
        sampled
    });
    let mut whole = PointCloud::default();
    for cloud in &uniplanar {
        whole.points.extend(&cloud.points);
        whole.planes.extend(&cloud.planes);
        whole.unique.extend(&cloud.unique);
    }
    let mut points = voxel_grid(&whole, parameters.leaf_mm).points;
    expect("merged_voxel", &points);
    points = those(&points, &radius_outlier::kept(&points, &parameters.radius_outlier, &Silent).unwrap());
    expect("after_radius", &points);
    points = those(
        &points,
        &statistical_outlier::kept(&points, &parameters.statistical_outlier, &Silent).unwrap(),
    );
    expect("after_statistical", &points);
    let unique = unique(&points, &uniplanar[0].points, parameters.unique_distance_mm);
    let ours: Vec<usize> = (0..points.len()).filter(|&i| unique[i]).collect();
    let theirs = their_unique(published, leaf);
    assert!(ours == theirs, "{name} unique leaf {leaf}: {} points, theirs {}", ours.len(), theirs.len());
}

/// The program's unique points as indices into its final cloud; it lists them in another order.
fn their_unique(published: &Published, leaf: &str) -> Vec<usize> {
    let bits = |p: &[f32; 3]| p.map(f32::to_bits);
    let cloud = published.points(&format!("after_statistical_leaf{leaf}"));
    let places: HashMap<_, usize> = cloud.iter().map(bits).zip(0..).collect();
    let unique = published.points(&format!("unique_leaf{leaf}"));
    let mut indices: Vec<usize> = unique.iter().map(|p| places[&bits(p)]).collect();
    indices.sort_unstable();
    indices
}

fn cloud(points: Vec<[f32; 3]>, plane: Plane) -> PointCloud {
    let (planes, unique) = (vec![PlaneSet::from(plane); points.len()], vec![false; points.len()]);
    PointCloud { points, planes, unique, ..PointCloud::default() }
}

fn those(points: &[[f32; 3]], kept: &[bool]) -> Vec<[f32; 3]> {
    assert_eq!(points.len(), kept.len(), "one answer a point");
    points.iter().zip(kept).filter(|&(_, &kept)| kept).map(|(&point, _)| point).collect()
}

/// Both clouds are ordered by cell, so that the points correspond one to one.
fn same(stage: &str, ours: &[[f32; 3]], theirs: &[[f32; 3]]) {
    assert_eq!(ours.len(), theirs.len(), "{stage}: number of points");
    for (index, (our, their)) in ours.iter().zip(theirs).enumerate() {
        let off = our.iter().zip(their).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off <= TOLERANCE, "{stage}: point {index} is {our:?}, theirs {their:?}");
    }
}
