//! Known motions of shapes without symmetry.

use super::*;
use crate::evaluation::Shape;
use crate::geometry::{add, cross, dot};

/// Rodrigues' rotation by `degrees` about `axis`, then `shift`.
fn motion(axis: Vec3, degrees: f64, shift: Vec3) -> impl Fn(Vec3) -> Vec3 {
    let axis = scale(axis, 1.0 / norm(axis));
    let (sin, cos) = degrees.to_radians().sin_cos();
    move |p| {
        let along = scale(axis, dot(axis, p) * (1.0 - cos));
        add(add(add(scale(p, cos), scale(cross(axis, p), sin)), along), shift)
    }
}

/// A head-sized egg with a nose and one ear: points of a surface that no motion maps to itself.
fn head(step: usize) -> Shape {
    const ROWS: usize = 120;
    const COLUMNS: usize = 240;
    let mut points = Vec::new();
    for row in 0..=ROWS {
        for column in 0..COLUMNS {
            let (a, b) = (
                std::f64::consts::PI * row as f64 / ROWS as f64,
                std::f64::consts::TAU * column as f64 / COLUMNS as f64,
            );
            let u = [a.sin() * b.cos(), a.sin() * b.sin(), a.cos()];
            let bump = |at: Vec3, height: f64| height * (-30.0 * (1.0 - dot(u, at))).exp();
            let radius =
                1.0 + bump([0.0, -1.0, 0.0], 0.25) + bump([0.98, 0.2, 0.0], 0.15) + 0.1 * u[2] * u[1];
            points.push([75.0 * radius * u[0], 95.0 * radius * u[1], 110.0 * radius * u[2]]);
        }
    }
    let mut triangles = Vec::new();
    for row in 0..ROWS as u32 {
        for column in 0..COLUMNS as u32 {
            let next = (column + 1) % COLUMNS as u32;
            let (above, below) = (row * COLUMNS as u32, (row + 1) * COLUMNS as u32);
            triangles.push([above + column, below + column, below + next]);
            triangles.push([above + column, below + next, above + next]);
        }
    }
    if step > 1 {
        return Shape::cloud(points.into_iter().step_by(step).collect());
    }
    Shape { triangles, ..Shape::cloud(points) }
}

#[test]
fn horn_finds_any_motion_of_points_in_general_position() {
    let points =
        [[1.0, 2.0, 3.0], [40.0, -3.0, 7.0], [-5.0, 60.0, 1.0], [9.0, 8.0, -70.0], [30.0, 31.0, 5.0]];
    for degrees in [0.0, 1e-5, 5.0, 90.0, 179.0, 180.0] {
        let moved = motion([1.0, -2.0, 0.5], degrees, [7.0, 8.0, -90.0]);
        let found = horn::fit(points.iter().map(|p| (*p, moved(*p))));
        for p in points {
            assert!(norm(sub(found.apply(p), moved(p))) < 1e-9, "{degrees} degrees");
        }
        assert!((found.angle_deg() - degrees).abs() < 1e-6, "{degrees}: {}", found.angle_deg());
    }
}

#[test]
fn horn_never_mirrors() {
    let points = [[1.0, 2.0, 3.0], [40.0, -3.0, 7.0], [-5.0, 60.0, 1.0], [9.0, 8.0, -70.0]];
    let r = horn::fit(points.iter().map(|p| (*p, [-p[0], p[1], p[2]]))).rotation;
    assert!((dot(r[0], cross(r[1], r[2])) - 1.0).abs() < 1e-9);
}

#[test]
fn motions_follow_each_other_in_order() {
    let points = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [3.0, 4.0, 5.0]];
    let (a, b) =
        (motion([0.0, 0.0, 1.0], 90.0, [1.0, 0.0, 0.0]), motion([1.0, 0.0, 0.0], 90.0, [0.0, 2.0, 0.0]));
    let (first, second) =
        (horn::fit(points.iter().map(|p| (*p, a(*p)))), horn::fit(points.iter().map(|p| (*p, b(*p)))));
    let both = second.after(&first);
    for p in points {
        assert!(norm(sub(both.apply(p), b(a(p)))) < 1e-9);
        let row = |axis: usize| both.matrix()[axis];
        let by_matrix =
            [0, 1, 2].map(|axis| dot([row(axis)[0], row(axis)[1], row(axis)[2]], p) + row(axis)[3]);
        assert!(norm(sub(by_matrix, b(a(p)))) < 1e-9);
    }
}

#[test]
fn a_misplaced_head_comes_back_onto_its_mesh() {
    let mesh = head(1);
    let target = Target::new(&mesh).unwrap();
    let away = motion([1.0, 2.0, -1.5], 5.0, [5.0, -4.0, 4.8]);
    let mut points: Vec<Vec3> = mesh.points.iter().step_by(7).map(|p| away(*p)).collect();
    // One point in fifty is no skin.
    points.iter_mut().step_by(50).for_each(|p| *p = scale(*p, 1.5));
    // The point-to-point steps get small long before the place is reached: the finer limit tests
    // the motion, not where CloudCompare's default would stop.
    let settings = Settings { min_rms_decrease_mm: 1e-7, ..Settings::PAPER };
    let found = register(&points, &target, settings).unwrap();
    assert!(found.rms_mm < 0.01, "{found:?}");
    assert!((found.rotation_deg - 5.0).abs() < 0.02, "{found:?}");
    assert!(found.points_removed > 0 && found.iterations > 5 && found.end != End::IterationLimit);
    assert!(found.initial_rms_mm > 1.0);
    for p in mesh.points.iter().step_by(997) {
        let start = away(*p);
        let row = |axis: usize| found.matrix[axis];
        let back =
            [0, 1, 2].map(|axis| dot([row(axis)[0], row(axis)[1], row(axis)[2]], start) + row(axis)[3]);
        assert!(norm(sub(back, *p)) < 0.05, "{back:?} {p:?}");
    }
}

#[test]
fn noise_stays_and_is_the_rms() {
    // A plane's distances are what was put there, in any pose that registration may find.
    let mut points = Vec::new();
    for x in 0..60 {
        for y in 0..40 {
            points.push([f64::from(x), f64::from(y), if (x + y) % 2 == 0 { 0.5 } else { -0.5 }]);
        }
    }
    let corners = vec![[-90.0, -90.0, 0.0], [160.0, -90.0, 0.0], [0.0, 200.0, 0.0]];
    let plane = Shape { triangles: vec![[0, 1, 2]], ..Shape::cloud(corners) };
    let all = Settings { overlap: 1.0, farthest_point_removal: false, ..Settings::PAPER };
    let found = register(&points, &Target::new(&plane).unwrap(), all).unwrap();
    assert!((found.rms_mm - 0.5).abs() < 1e-3 && found.points_used == 2400, "{found:?}");
}

#[test]
fn a_cloud_on_itself_does_not_move() {
    let shape = head(3);
    let found = register(&shape.points, &Target::new(&shape).unwrap(), Settings::PAPER).unwrap();
    assert_eq!((found.rms_mm, found.iterations, found.end), (0.0, 0, End::Converged));
    assert_eq!(found.matrix, Rigid::IDENTITY.matrix());
    assert_eq!(register(&shape.points[..3], &Target::new(&shape).unwrap(), Settings::PAPER), None);
}

#[test]
fn what_fixes_no_motion_is_doubtful() {
    let head = head(3);
    let target = Target::new(&head).unwrap();
    let doubtful = |points: &[Vec3]| register(points, &target, Settings::PAPER).unwrap().is_doubtful;
    let moved = motion([1.0, 2.0, -1.5], 2.0, [1.0, -2.0, 1.5]);
    let points: Vec<Vec3> = head.points.iter().step_by(5).map(|p| moved(*p)).collect();
    assert!(!doubtful(&points));
    assert!(doubtful(&(0..50).map(|i| [f64::from(i), 3.0, 2.0]).collect::<Vec<_>>()), "a line");
    assert!(doubtful(&[[1.0, 2.0, 3.0]; 20]), "one place");
    let far: Vec<Vec3> = points.iter().map(|p| add(*p, [1e6, 0.0, 0.0])).collect();
    assert!(doubtful(&far), "all have the same point of the target nearest");
    let apart: Vec<Vec3> = points.iter().map(|p| add(*p, [400.0, 0.0, 0.0])).collect();
    assert!(doubtful(&apart), "nothing of the two lies in the same place");
}
