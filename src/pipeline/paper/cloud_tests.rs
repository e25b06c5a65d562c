//! The stages of the cloud against brute force.

use std::collections::BTreeMap;

use proptest::prelude::*;

use super::voxel_grid::voxel_grid;
use super::{radius_outlier, statistical_outlier};
use crate::cloud::PointCloud;
use crate::geometry::PlaneSet;
use crate::observer::Silent;
use crate::pipeline::neighbours::cells::squared_distance;
use crate::pipeline::neighbours::unique::unique;
use crate::pipeline::parameters::{RadiusOutlier, StatisticalOutlier};

/// Points on a lattice of 0.25 mm, so that distances fall exactly on the limits.
fn points(most: usize) -> impl Strategy<Value = Vec<[f32; 3]>> {
    prop::collection::vec(prop::array::uniform3(-40_i16..40), 0..most)
        .prop_map(|points| points.into_iter().map(|p| p.map(|v| f32::from(v) * 0.25)).collect())
}

fn clouds() -> impl Strategy<Value = PointCloud> {
    let point = (prop::array::uniform3(-500.0_f32..500.0), 1..8_u8);
    prop::collection::vec(point, 0..300).prop_map(|points| PointCloud {
        points: points.iter().map(|(point, _)| *point).collect(),
        planes: points.iter().map(|&(_, planes)| PlaneSet::from_bits(planes)).collect(),
        unique: vec![false; points.len()],
        ..PointCloud::default()
    })
}

fn voxel_grid_twin(cloud: &PointCloud, leaf: f32) -> Vec<([f64; 3], PlaneSet)> {
    let cell = |p: [f32; 3]| [p[2], p[1], p[0]].map(|v| (v * (1.0 / leaf)).floor() as i64);
    let mut cells: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for (index, &point) in cloud.points.iter().enumerate() {
        cells.entry(cell(point)).or_default().push(index);
    }
    cells
        .values()
        .map(|members| {
            let mean = |axis: usize| {
                members.iter().map(|&i| f64::from(cloud.points[i][axis])).sum::<f64>() / members.len() as f64
            };
            let planes = members.iter().fold(PlaneSet::EMPTY, |set, &i| set.union(cloud.planes[i]));
            ([mean(0), mean(1), mean(2)], planes)
        })
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_voxel_grid_has_the_centroid_of_every_occupied_cell(cloud in clouds(), leaf in 0.05_f32..40.0) {
        let twin = voxel_grid_twin(&cloud, leaf);
        let grid = voxel_grid(&cloud, leaf);
        prop_assert_eq!(grid.len(), twin.len());
        for ((point, planes), (twin, twin_planes)) in grid.points.iter().zip(&grid.planes).zip(&twin) {
            prop_assert_eq!(planes, twin_planes);
            for axis in 0..3 {
                prop_assert!((f64::from(point[axis]) - twin[axis]).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn the_radius_filter_counts_the_points_within_the_radius_inclusive(
        points in points(300),
        radius in prop::sample::select(vec![0.25_f32, 1.0, 2.5, 5.0, 30.0]),
        min_neighbours in 1..40_u32,
    ) {
        let kept = radius_outlier::kept(&points, &RadiusOutlier { radius_mm: radius, min_neighbours }, &Silent).unwrap();
        for (&point, kept) in points.iter().zip(kept) {
            let near = points.iter().filter(|&&p| squared_distance(point, p) <= radius * radius).count();
            prop_assert_eq!(kept, near > min_neighbours as usize);
        }
    }

    #[test]
    fn the_statistical_filter_drops_what_exceeds_the_limit(
        points in points(200),
        neighbours in 1..30_u32,
        deviations in 0.0..3.0_f64,
    ) {
        let kept = statistical_outlier::kept(&points, &StatisticalOutlier { neighbours, deviations }, &Silent).unwrap();
        prop_assert_eq!(kept.len(), points.len());
        let others = (neighbours as usize).min(points.len().saturating_sub(1));
        let means: Vec<f64> = points
            .iter()
            .map(|&point| {
                let mut distances: Vec<f32> = points.iter().map(|&p| squared_distance(point, p)).collect();
                distances.sort_by(f32::total_cmp);
                distances.iter().skip(1).take(others).map(|d| f64::from(d.sqrt())).sum::<f64>() / others as f64
            })
            .collect();
        let count = means.len() as f64;
        let mean = means.iter().sum::<f64>() / count;
        let variance = means.iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / (count - 1.0);
        let limit = mean + deviations * variance.sqrt();
        for (mean, kept) in means.into_iter().zip(kept) {
            // Where the mean is the limit, single precision may tip it either way.
            if points.len() > 1 && (mean - limit).abs() > 1e-4 {
                prop_assert_eq!(kept, mean <= limit);
            }
        }
    }

    #[test]
    fn a_point_is_unique_if_no_axial_point_is_nearer(points in points(150), axial in points(150)) {
        let found = unique(&points, &axial, 1.0);
        for (&point, unique) in points.iter().zip(found) {
            prop_assert_eq!(unique, !axial.iter().any(|&a| squared_distance(point, a) < 1.0));
        }
    }
}

#[test]
fn a_cell_so_small_that_there_are_more_than_2_to_the_63_is_no_obstacle() {
    let cloud = PointCloud {
        points: vec![[1e30, -1e30, 0.0], [-1e30, 1e30, f32::MAX], [0.0; 3]],
        planes: vec![PlaneSet::EMPTY; 3],
        unique: vec![false; 3],
        ..PointCloud::default()
    };
    assert_eq!(voxel_grid(&cloud, 0.05).len(), 3);
    let radius = RadiusOutlier { radius_mm: 0.1, min_neighbours: 1 };
    assert_eq!(radius_outlier::kept(&cloud.points, &radius, &Silent).unwrap(), [false; 3]);
    assert_eq!(unique(&cloud.points, &cloud.points, 1.0), [false; 3]);
}

#[test]
fn filters_that_are_switched_off_keep_everything() {
    let points = [[0.0; 3], [1e3; 3]];
    let radius = RadiusOutlier { radius_mm: 1.0, min_neighbours: 0 };
    let statistical = StatisticalOutlier { neighbours: 0, deviations: 0.0 };
    assert_eq!(radius_outlier::kept(&points, &radius, &Silent).unwrap(), [true, true]);
    assert_eq!(statistical_outlier::kept(&points, &statistical, &Silent).unwrap(), [true, true]);
}

#[test]
fn clouds_of_few_points_and_of_many_equal_ones_are_no_obstacle() {
    let filter = StatisticalOutlier::default();
    assert!(statistical_outlier::kept(&[], &filter, &Silent).unwrap().is_empty());
    assert_eq!(statistical_outlier::kept(&[[1.0; 3]], &filter, &Silent).unwrap(), [true]);
    assert_eq!(statistical_outlier::kept(&[[1.0; 3], [2.0; 3]], &filter, &Silent).unwrap(), [true, true]);
    assert_eq!(statistical_outlier::kept(&[[1.0; 3]; 5_000], &filter, &Silent).unwrap(), [true; 5_000]);
    assert_eq!(
        radius_outlier::kept(&[[1.0; 3]; 251], &RadiusOutlier::default(), &Silent).unwrap(),
        [true; 251]
    );
    assert_eq!(
        radius_outlier::kept(&[[1.0; 3]; 250], &RadiusOutlier::default(), &Silent).unwrap(),
        [false; 250]
    );
}
