//! Our border following against another implementation, and the polygon's measures against what
//! they are by definition.

use std::collections::BTreeSet;

use imageproc::contours::{BorderType, find_contours};
use proptest::prelude::*;

use super::{ContourThresholds, external_contours, filled, outline, polygon};
use crate::geometry::Plane;
use crate::pipeline::paper::bitmap::Bitmap;
use crate::pipeline::slices::Pixel;

fn bitmaps() -> impl Strategy<Value = Bitmap> {
    (1..24_usize, 1..24_usize, 0.1..0.9_f64).prop_flat_map(|(width, height, density)| {
        prop::collection::vec(prop::bool::weighted(density), width * height).prop_map(move |white| {
            let mut bitmap = Bitmap::new(width, height);
            for index in (0..white.len()).filter(|&i| white[i]) {
                bitmap.set_white(index / width, index % width);
            }
            bitmap
        })
    })
}

/// imageproc's outermost borders; it needs a black frame, which is taken off again.
fn twin(bitmap: &Bitmap) -> Vec<Vec<Pixel>> {
    let (width, height) = (bitmap.width() as u32, bitmap.height() as u32);
    let image = image::GrayImage::from_fn(width + 2, height + 2, |x, y| {
        let inside = (1..=width).contains(&x) && (1..=height).contains(&y);
        let white = inside && bitmap.is_white(y as usize - 1, x as usize - 1);
        image::Luma([u8::from(white)])
    });
    find_contours::<u32>(&image)
        .into_iter()
        .filter(|contour| contour.border_type == BorderType::Outer && contour.parent.is_none())
        .map(|c| c.points.iter().map(|p| Pixel { row: p.y - 1, column: p.x - 1 }).collect())
        .collect()
}

/// Pixels that the outside can't reach through black 4-neighbours.
fn enclosed(bitmap: &Bitmap) -> BTreeSet<Pixel> {
    let (width, height) = (bitmap.width() as i64, bitmap.height() as i64);
    let mut outside = BTreeSet::from([(-1, -1)]);
    let mut open = vec![(-1_i64, -1_i64)];
    while let Some((row, column)) = open.pop() {
        for (r, c) in [(row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)] {
            let framed = (-1..=height).contains(&r) && (-1..=width).contains(&c);
            let in_picture = (0..height).contains(&r) && (0..width).contains(&c);
            let is_white = in_picture && bitmap.is_white(r as usize, c as usize);
            if framed && !is_white && outside.insert((r, c)) {
                open.push((r, c));
            }
        }
    }
    all(bitmap).filter(|p| !outside.contains(&(i64::from(p.row), i64::from(p.column)))).collect()
}

fn all(bitmap: &Bitmap) -> impl Iterator<Item = Pixel> {
    let (width, height) = (bitmap.width() as u32, bitmap.height() as u32);
    (0..height).flat_map(move |row| (0..width).map(move |column| Pixel { row, column }))
}

fn white(bitmap: &Bitmap) -> BTreeSet<Pixel> {
    all(bitmap).filter(|p| bitmap.is_white(p.row as usize, p.column as usize)).collect()
}

/// The hull's area by definition: the largest triangle fan that no point lies outside of, summed
/// over all edges of the hull found by gift wrapping.
fn hull_area_twin(points: &[Pixel]) -> f64 {
    let at = |p: Pixel| (f64::from(p.column), f64::from(p.row));
    let turn = |a: Pixel, b: Pixel, c: Pixel| {
        let ((ax, ay), (bx, by), (cx, cy)) = (at(a), at(b), at(c));
        (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    };
    let distance = |a: Pixel, b: Pixel| (at(a).0 - at(b).0).hypot(at(a).1 - at(b).1);
    let first = *points.iter().min().expect("a contour has points");
    let mut hull = vec![first];
    loop {
        let here = hull[hull.len() - 1];
        let next = points.iter().copied().filter(|&p| p != here).reduce(|best, p| {
            let side = turn(here, best, p);
            if side < 0.0 || side == 0.0 && distance(here, p) > distance(here, best) { p } else { best }
        });
        match next {
            Some(next) if next != first => hull.push(next),
            _ => return polygon::area(&hull),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn contours_are_those_of_imageproc(bitmap in bitmaps()) {
        let theirs = twin(&bitmap);
        let ours = external_contours(&mut bitmap.clone());
        prop_assert_eq!(ours.len(), theirs.len());
        for (our, their) in ours.iter().zip(&theirs) {
            let set = |contour: &[Pixel]| contour.iter().copied().collect::<BTreeSet<_>>();
            prop_assert_eq!(set(our), set(their));
            prop_assert_eq!(polygon::area(our), polygon::area(their));
        }
    }

    #[test]
    fn a_filled_component_is_all_that_it_encloses(bitmap in bitmaps()) {
        let mut traced = bitmap.clone();
        let contours = external_contours(&mut traced);
        prop_assert_eq!(white(&filled(&traced, &contours)), enclosed(&bitmap));
    }

    #[test]
    fn the_hull_is_the_gift_wrapped_one(bitmap in bitmaps()) {
        for contour in external_contours(&mut bitmap.clone()) {
            prop_assert_eq!(polygon::hull_area(&contour), hull_area_twin(&contour));
        }
    }

    #[test]
    fn solidity_is_above_0_to_1_and_the_cut_contour_keeps_off_row_0(bitmap in bitmaps()) {
        let thresholds = ContourThresholds {
            min_area: 0.0,
            axial_window_min: -1.0,
            ..ContourThresholds::default()
        };
        if let Some(outline) = outline(bitmap, Plane::Axial, &thresholds) {
            prop_assert!(outline.contour.solidity > 0.0 && outline.contour.solidity <= 1.0);
            prop_assert!(outline.contour.pixels.iter().all(|p| p.row > 0));
        }
    }
}

#[test]
fn a_square_has_the_area_between_its_pixel_centres_and_its_centroid_in_the_middle() {
    let mut bitmap = Bitmap::new(40, 30);
    for (row, column) in (10..=20).flat_map(|r| (5..=25).map(move |c| (r, c))) {
        bitmap.set_white(row, column);
    }
    let contours = external_contours(&mut bitmap);
    assert_eq!(contours.len(), 1);
    assert_eq!(contours[0].len(), 2 * (10 + 20));
    assert_eq!(polygon::area(&contours[0]), 200.0);
    assert_eq!(polygon::centroid(&contours[0]), Some([15.0, 15.0]));
}

#[test]
fn a_neck_that_the_image_cuts_is_closed_on_row_0() {
    let mut bitmap = Bitmap::new(60, 60);
    // A U that is open towards row 0.
    for row in 0..40 {
        for column in (10..15).chain(45..50) {
            bitmap.set_white(row, column);
        }
    }
    for (row, column) in (35..40).flat_map(|r| (10..50).map(move |c| (r, c))) {
        bitmap.set_white(row, column);
    }
    let thresholds =
        ContourThresholds { axial_window_min: 0.0, min_area: 100.0, ..ContourThresholds::default() };
    let outline = outline(bitmap, Plane::Axial, &thresholds).expect("a contour");
    // Rows 1 to 39 of columns 10 to 49, once the points on row 0 are gone.
    assert_eq!(outline.contour.area, 38.0 * 39.0);
    assert_eq!(outline.contour.solidity, 1.0);
}

#[test]
fn nothing_large_enough_is_no_outline() {
    let mut bitmap = Bitmap::new(512, 512);
    bitmap.set_white(256, 256);
    assert!(outline(bitmap, Plane::Axial, &ContourThresholds::default()).is_none());
}
