//! Shapes whose figures are known.

use super::*;
use crate::geometry::{norm, scale};

/// An icosphere's points on the unit sphere and its faces, wound outward, `levels` times divided.
fn icosphere(levels: usize) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut points: Vec<Vec3> = vec![
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, -1.0],
    ];
    let mut faces: Vec<[u32; 3]> =
        vec![[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [5, 2, 1], [5, 3, 2], [5, 4, 3], [5, 1, 4]];
    for _ in 0..levels {
        let mut halves = std::collections::HashMap::new();
        let mut next = Vec::new();
        for [a, b, c] in faces {
            let mut half = |a: u32, b: u32| {
                *halves.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                    let sum = crate::geometry::add(points[a as usize], points[b as usize]);
                    points.push(scale(sum, 1.0 / norm(sum)));
                    u32::try_from(points.len() - 1).unwrap()
                })
            };
            let (ab, bc, ca) = (half(a, b), half(b, c), half(c, a));
            next.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        faces = next;
    }
    (points, faces)
}

fn sphere(radius: f64) -> Shape {
    let (points, triangles) = icosphere(6);
    Shape { triangles, ..Shape::cloud(points.iter().map(|p| scale(*p, radius)).collect()) }
}

/// An axis-parallel box around the origin, its faces wound outward.
fn cube(half: f64) -> Shape {
    let corner = |n: u32| [0, 1, 2].map(|axis| if n >> axis & 1 == 1 { half } else { -half });
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Shape { triangles, ..Shape::cloud((0..8).map(corner).collect()) }
}

#[test]
fn a_smaller_sphere_lies_inside_by_the_difference_of_the_radii() {
    let truth = sphere(100.0);
    let inner: Vec<Vec3> = truth.points.iter().map(|p| scale(*p, 0.993)).collect();
    let found = evaluate(&inner, &truth, None, Settings::PAPER).unwrap();
    assert_eq!(found.sign, Sign::Faces);
    let distances = &found.distances;
    assert!((distances.bias_mm.unwrap() + 0.7).abs() < 0.01, "{distances:?}");
    assert!((distances.rms_mm - 0.7).abs() < 0.01 && (distances.p99_mm - 0.7).abs() < 0.02);
    assert_eq!(distances.stray_share, 0.0);
    assert_eq!(found.over_axial, None);
}

#[test]
fn the_winding_decides_nothing_but_whether_there_is_a_sign() {
    let points =
        vec![[11.0, 0.5, 0.2], [9.0, 0.1, 0.3], [12.0, 12.0, 12.0], [0.0, -10.5, 0.0], [13.0, 0.0, 14.0]];
    // By hand: one outside a face, one inside, one off a corner, one off a face, one off an edge.
    let truth = [1.0, -1.0, 12.0_f64.sqrt(), 0.5, 5.0];
    let mut shape = cube(10.0);
    let outside = |shape: &Shape| -> Vec<Option<f64>> {
        Target::new(shape).unwrap().nearest(&points, &[]).iter().map(|n| n.outside).collect()
    };
    let is_truth = |found: &[Option<f64>]| {
        found.iter().zip(truth).all(|(found, truth)| (found.unwrap() - truth).abs() < 1e-12)
    };
    assert!(is_truth(&outside(&shape)), "{:?}", outside(&shape));
    shape.triangles.iter_mut().for_each(|triangle| triangle.swap(0, 1));
    assert!(is_truth(&outside(&shape)), "wound inward");
    // Every corner on its own, as in STL.
    let corners: Vec<Vec3> =
        shape.triangles.iter().flatten().map(|&index| shape.points[index as usize]).collect();
    let alone = (0..12).map(|n| [3 * n, 3 * n + 1, 3 * n + 2]).collect();
    assert!(is_truth(&outside(&Shape { triangles: alone, ..Shape::cloud(corners) })));
    shape.triangles[0].swap(0, 1);
    assert_eq!(outside(&shape), [None; 5], "one triangle the other way");
    assert_eq!(Target::new(&shape).unwrap().sign(), Sign::None);
}

#[test]
fn half_a_sphere_covers_half() {
    let truth = sphere(40.0);
    let half: Vec<Vec3> = truth.points.iter().copied().filter(|p| p[0] >= 0.0).collect();
    let found = evaluate(&half, &truth, None, Settings::PAPER).unwrap();
    // The cap that reaches d over the equator has the share (1 + d / r) / 2; points are about 1 mm apart.
    let coverage = &found.coverage;
    assert!((coverage.within_1_5_mm - (1.0 + 1.5 / 40.0) / 2.0).abs() < 0.004, "{coverage:?}");
    assert!(coverage.within_1_mm < coverage.within_1_5_mm && coverage.within_1_mm > 0.49);
    // 4 π r² / 0.5².
    assert!((coverage.points as f64 / 80_425.0 - 1.0).abs() < 0.01 && coverage.spacing_mm == Some(0.5));
}

#[test]
fn a_cloud_as_truth_has_signs_only_with_normals() {
    let (directions, _) = icosphere(5);
    let mut truth = Shape::cloud(directions.iter().map(|p| scale(*p, 50.0)).collect());
    let outer: Vec<Vec3> = directions.iter().map(|p| scale(*p, 50.4)).collect();
    let found = evaluate(&outer, &truth, None, Settings::PAPER).unwrap();
    assert_eq!((found.sign, found.distances.bias_mm), (Sign::None, None));
    assert_eq!((found.coverage.points, found.coverage.spacing_mm), (directions.len(), None));
    truth.normals = Some(directions.iter().map(|n| scale(*n, 3.0)).collect());
    let found = evaluate(&outer, &truth, None, Settings::PAPER).unwrap();
    assert_eq!(found.sign, Sign::Normals);
    assert!(
        (found.distances.bias_mm.unwrap() - 0.4).abs() < 1e-9 && (found.distances.rms_mm - 0.4).abs() < 1e-9
    );
}

#[test]
fn unique_and_additional_points_are_counted_as_the_paper_does() {
    let line = |n: i32| [f64::from(n) * 0.5, 3.0, -7.0];
    let cloud: Vec<Vec3> = (0..100).map(line).collect();
    let axial: Vec<Vec3> = (0..80).map(line).collect();
    let over = evaluate(&cloud, &Shape::cloud(cloud.clone()), Some(&axial), Settings::PAPER)
        .unwrap()
        .over_axial
        .unwrap();
    // The last axial point is at 39.5: 40.5 is exactly 1 mm off, which is unique.
    assert_eq!((over.additional, over.additional_share), (20, 0.25));
    assert_eq!((over.unique.points, over.unique.share), (19, 0.19));
    assert_eq!(over.axial_coverage.within_1_mm, 0.82);
}

#[test]
fn what_is_empty_is_named() {
    let some = [[0.0; 3]; 5];
    let nothing = Shape::default();
    let truth = Shape::cloud(some.to_vec());
    assert_eq!(evaluate(&some, &nothing, None, Settings::PAPER), Err(Empty("the truth")));
    assert_eq!(evaluate(&[], &truth, None, Settings::PAPER), Err(Empty("the cloud")));
    assert_eq!(evaluate(&some, &truth, Some(&[]), Settings::PAPER), Err(Empty("the axial cloud")));
    assert!(evaluate(&some, &truth, None, Settings::PAPER).is_ok(), "points in one place");
}
