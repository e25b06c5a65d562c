//! Whole pictures of shapes whose sides differ.

use image::{Rgb, RgbImage};

use super::*;
use crate::geometry::Vec3;

const OPTIONS: Options = Options {
    views: Vec::new(),
    colouring: Colouring::Height,
    max_error_mm: 0.5,
    panel_height: 200,
    theme: Theme::Light,
};

/// A bar through all of x, y and z, with a knob at its patient-left, anterior, superior end only.
fn knob() -> Shape {
    let mut points = Vec::new();
    for n in -50..=50 {
        let t = f64::from(n);
        points.extend([[t, 0.0, 0.0], [0.0, t, 0.0], [0.0, 0.0, t]]);
    }
    for a in -8..=8 {
        for b in -8..=8 {
            for c in -8..=8 {
                let offset: Vec3 = [f64::from(a), f64::from(b), f64::from(c)];
                points.push([40.0 + offset[0], -40.0 + offset[1], 40.0 + offset[2]]);
            }
        }
    }
    Shape::cloud(points)
}

/// The columns of a picture in which something is drawn at the height of a panel's middle.
fn drawn_columns(image: &RgbImage) -> Vec<u32> {
    let row = 24 + 64 + 80;
    (0..image.width()).filter(|x| *image.get_pixel(*x, row) != Rgb([255; 3])).collect()
}

#[test]
fn clouds_of_one_head_share_their_place_and_strangers_do_not() {
    let sheet = |left: f64| {
        let line = (-30..=30).flat_map(|x| (-30..=30).map(move |z| [f64::from(x), 0.0, f64::from(z)]));
        Shape::cloud(line.map(|[x, y, z]| [x + left, y, z]).collect())
    };
    let first_gap = |left: f64| {
        let (a, b) = (sheet(0.0), sheet(left));
        let subject = |shape| Subject { shape, caption: String::new() };
        let options = Options { views: vec![View::Front], ..OPTIONS };
        let image = draw(&[subject(&a), subject(&b)], &options);
        // The margin of 24 stands once at the left and once behind each panel.
        let panel = (image.width() - 24) / 2;
        let columns = drawn_columns(&image);
        let mean = |from: u32| {
            let inside: Vec<_> = columns.iter().filter(|x| (from..from + panel).contains(x)).collect();
            f64::from(inside.iter().map(|x| **x - from).sum::<u32>()) / inside.len() as f64
        };
        mean(panel) - mean(0)
    };
    assert!(first_gap(20.0) > 10.0, "shifted within the same head");
    assert!(first_gap(500.0).abs() < 4.0, "another place");
}

/// Shares of the width and height at which the middle of everything drawn in the only panel lies.
fn centre(image: &RgbImage) -> [f64; 2] {
    let (mut sum, mut count) = ([0.0; 2], 0.0);
    let top = 24 + 64;
    for y in top..top + 180 {
        // Letters of the directions and the scale bar are beside this.
        for x in 45..image.width() - 45 {
            if *image.get_pixel(x, y) != Rgb([255; 3]) {
                (sum, count) = ([sum[0] + f64::from(x), sum[1] + f64::from(y - top)], count + 1.0);
            }
        }
    }
    [sum[0] / count / f64::from(image.width()), sum[1] / count / 200.0]
}

#[test]
fn each_view_shows_the_knob_on_its_own_side() {
    let shape = knob();
    let subjects = [Subject { shape: &shape, caption: "knob".to_owned() }];
    for (view, is_right, is_up) in [
        (View::Front, true, true),
        (View::Back, false, true),
        (View::Left, false, true),
        (View::Right, true, true),
        // Anterior is up, the patient's left at the left.
        (View::Top, false, true),
    ] {
        let [x, y] = centre(&draw(&subjects, &Options { views: vec![view], ..OPTIONS }));
        assert_eq!((x > 0.6, x < 0.4), (is_right, !is_right), "{}: {x}", view.name());
        assert_eq!(y < 0.4, is_up, "{}: {y}", view.name());
    }
}

#[test]
fn what_is_nearer_hides_what_is_behind() {
    // Two sheets: the left one in plane `axial`, the right one `sagittal`; each view sees its own.
    let sheet =
        |x: f64| (-30..=30).flat_map(move |y| (-30..=30).map(move |z| [x, f64::from(y), f64::from(z)]));
    let points: Vec<Vec3> = sheet(20.0).chain(sheet(-20.0)).collect();
    let half = points.len() / 2;
    let planes = [vec![1.0; half], vec![2.0; half]].concat();
    let shape = Shape { properties: vec![("planes".to_owned(), planes)], ..Shape::cloud(points) };
    let subjects = [Subject { shape: &shape, caption: String::new() }];
    let middle = |view: View| {
        let image = draw(&subjects, &Options { views: vec![view], colouring: Colouring::Plane, ..OPTIONS });
        let Rgb([red, green, _]) = *image.get_pixel(image.width() / 2, 24 + 64 + 100);
        red > green
    };
    assert!(middle(View::Left), "red is axial");
    assert!(!middle(View::Right), "green is sagittal");
}

#[test]
fn the_error_is_on_the_ramp_and_unknown_ones_are_grey() {
    let points: Vec<Vec3> =
        (-30..=30).flat_map(|x| (-30..=30).map(move |z| [f64::from(x), 0.0, f64::from(z)])).collect();
    let at_the_middle = |errors: Option<f32>| {
        let properties = errors
            .map(|error| ("expected_error_mm".to_owned(), vec![error; points.len()]))
            .into_iter()
            .collect();
        let shape = Shape { properties, ..Shape::cloud(points.clone()) };
        let subjects = [Subject { shape: &shape, caption: String::new() }];
        let options = Options { views: vec![View::Front], colouring: Colouring::Error, ..OPTIONS };
        let image = draw(&subjects, &options);
        image.get_pixel(image.width() / 2, 24 + 64 + 100).0.map(i32::from)
    };
    let [red, _, blue] = at_the_middle(Some(0.01));
    assert!(blue > red + 40, "small errors are blue");
    let [red, _, blue] = at_the_middle(Some(5.0));
    assert!(red > blue + 40, "large errors are yellow");
    let [red, green, blue] = at_the_middle(None);
    assert!((red - green).abs() < 12 && (green - blue).abs() < 12, "grey");
}

#[test]
fn pictures_are_the_same_on_any_number_of_threads() {
    let shape = knob();
    let picture = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let subject = || Subject { shape: &shape, caption: "Aq 1/2?".to_owned() };
        let options = Options { views: View::ALL.to_vec(), colouring: Colouring::Normal, ..OPTIONS };
        pool.install(|| draw(&[subject(), subject()], &options))
    };
    assert!(picture(1) == picture(4));
}

#[test]
fn nothing_and_a_single_point_are_drawn_too() {
    for points in [vec![], vec![[3.0; 3]], vec![[1.0; 3]; 40]] {
        let shape = Shape::cloud(points);
        for colouring in Colouring::ALL {
            let subjects = [Subject { shape: &shape, caption: "x".repeat(300) }];
            let image = draw(&subjects, &Options { views: vec![View::Front], colouring, ..OPTIONS });
            assert!(image.width() > 100 && image.height() > 200);
        }
    }
}
