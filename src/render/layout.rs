//! Panels, captions, legend.

use image::{Rgb, RgbImage};

use super::colour::{colours, heights, seen};
use super::legend::{self, Legend};
use super::splat::{Camera, splat};
use super::surface::Surface;
use super::{Options, Subject, View, font, shade};
use crate::geometry::{Vec3, add, scale, sub};

/// Each pixel of the picture is the mean of so many times so many.
const FINER: usize = 2;
/// Around the picture and between panels, pixels.
const MARGIN: u32 = 24;
/// Above a panel: two lines of text.
const CAPTION: u32 = 64;
/// Beside a cloud, for the letters of the patient's directions, pixels.
const SIDE: u32 = 24;
/// A caption needs some width, pixels.
const MIN_WIDTH: u32 = 260;
/// Share of a panel's height that its cloud fills.
const FILLED: f64 = 0.94;
/// More panels than this in all, and each cloud gets a row of its own.
const MAX_IN_A_ROW: usize = 4;
/// Points whose normal points away from the viewer by more are on the other side of the head.
const BEHIND: f64 = -0.25;

/// Ends of a box along each axis, LPS mm.
type Bounds = [Vec3; 2];

/// The smallest box around these points.
fn bounds<'a>(points: impl Iterator<Item = &'a Vec3>) -> Bounds {
    let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for point in points {
        for axis in 0..3 {
            bounds[0][axis] = bounds[0][axis].min(point[axis]);
            bounds[1][axis] = bounds[1][axis].max(point[axis]);
        }
    }
    // Nothing still has a size.
    if bounds[0][0] > bounds[1][0] { [[-1.0; 3], [1.0; 3]] } else { bounds }
}

/// The box that is shown of each cloud. Clouds of one head share theirs, so that what one lacks is
/// seen; clouds in different places are each shown in their own, of the same size.
fn shown(subjects: &[Subject<'_>]) -> Vec<Bounds> {
    let own: Vec<Bounds> = subjects.iter().map(|subject| bounds(subject.shape.points.iter())).collect();
    let overlap =
        |a: &Bounds, b: &Bounds| (0..3).all(|axis| a[0][axis] <= b[1][axis] && b[0][axis] <= a[1][axis]);
    if own.iter().all(|a| own.iter().all(|b| overlap(a, b))) {
        return vec![bounds(own.iter().flatten()); own.len()];
    }
    let size = |axis: usize| own.iter().map(|b| b[1][axis] - b[0][axis]).fold(0.0, f64::max);
    let half = [0, 1, 2].map(|axis| size(axis) / 2.0);
    own.iter().map(|b| [add(middle(b), half.map(|h| -h)), add(middle(b), half)]).collect()
}

fn middle([low, high]: &Bounds) -> Vec3 {
    scale(add(*low, *high), 0.5)
}

/// The picture: a panel for each view of each cloud, all at the same scale, with captions above and
/// the legend below.
#[must_use]
pub fn draw(subjects: &[Subject<'_>], options: &Options) -> RgbImage {
    let shown = shown(subjects);
    let [low, high] = shown.first().copied().unwrap_or([[-1.0; 3], [1.0; 3]]);
    let extent = |view: View| {
        let size = view.project(sub(high, low));
        [size[0].abs().max(1.0), size[1].abs().max(1.0)]
    };
    let tallest = options.views.iter().map(|view| extent(*view)[1]).fold(1.0, f64::max);
    let per_mm = f64::from(options.panel_height) * FILLED / tallest;
    let widths: Vec<u32> = options
        .views
        .iter()
        .map(|view| (pixels(extent(*view)[0] * per_mm) + 2 * SIDE).max(MIN_WIDTH))
        .collect();

    let of_a_cloud = widths.iter().map(|width| width + MARGIN).sum::<u32>();
    let count = u32::try_from(subjects.len()).unwrap_or(u32::MAX).max(1);
    let is_one_row = subjects.len() * options.views.len() <= MAX_IN_A_ROW;
    let (across, rows) = if is_one_row { (count, 1) } else { (1, count) };
    let row_height = CAPTION + options.panel_height + MARGIN;
    let size = [MARGIN + of_a_cloud * across, MARGIN + row_height * rows + legend::HEIGHT + MARGIN];
    let mut image = RgbImage::from_pixel(size[0], size[1], options.theme.background());

    let heights = heights(subjects);
    for ((subject, shown), number) in subjects.iter().zip(&shown).zip(0..) {
        let surface = Surface::new(subject.shape);
        let colours = colours(subject, &surface.normals, heights, options);
        let (mut left, top) = match is_one_row {
            true => (MARGIN + number * of_a_cloud, MARGIN),
            false => (MARGIN, MARGIN + number * row_height),
        };
        for (view, width) in options.views.iter().zip(&widths) {
            let camera = Camera {
                view: *view,
                middle: middle(shown),
                scale: per_mm,
                size: [*width, options.panel_height].map(|n| n as usize),
            };
            caption(&mut image, subject, &camera, [left, top], options);
            panel(&mut image, subject, &surface, &colours, &camera, [left, top + CAPTION]);
            left += width + MARGIN;
        }
    }
    scale_bar(&mut image, per_mm, MARGIN + row_height * rows - MARGIN, options);
    let legend = Legend::new(subjects, heights, options);
    legend.draw(&mut image, size[0] / 2, MARGIN + row_height * rows, options.theme.ink());
    image
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn pixels(length: f64) -> u32 {
    length.ceil() as u32
}

/// The cloud, at `at`.
fn panel(
    image: &mut RgbImage,
    subject: &Subject<'_>,
    surface: &Surface,
    colours: &[[f32; 3]],
    camera: &Camera,
    at: [u32; 2],
) {
    let normals = seen(&surface.normals, camera.view);
    let is_shown = |index: usize| !surface.has_own_normals || normals[index][2] > BEHIND;
    let fine = Camera { scale: camera.scale * FINER as f64, size: camera.size.map(|n| n * FINER), ..*camera };
    let visible = splat(&subject.shape.points, is_shown, surface.radius, &fine);
    let lit = shade::shade(&visible, fine.size[0], colours, &normals);
    for row in 0..camera.size[1] {
        for column in 0..camera.size[0] {
            let parts = (0..FINER * FINER).map(|part| {
                let (y, x) = (row * FINER + part / FINER, column * FINER + part % FINER);
                lit[y * fine.size[0] + x]
            });
            let place = u32::try_from(column).ok().zip(u32::try_from(row).ok());
            let pixel = place.and_then(|(x, y)| image.get_pixel_mut_checked(at[0] + x, at[1] + y));
            if let Some(pixel) = pixel {
                *pixel = mean(parts, *pixel);
            }
        }
    }
}

/// The mean colour; where nothing is seen, the background counts.
fn mean(parts: impl Iterator<Item = Option<Rgb<u8>>>, background: Rgb<u8>) -> Rgb<u8> {
    let (mut sum, mut count) = ([0_u16; 3], 0);
    for part in parts {
        let Rgb(colour) = part.unwrap_or(background);
        sum = [0, 1, 2].map(|c| sum[c] + u16::from(colour[c]));
        count += 1;
    }
    Rgb(sum.map(|c| u8::try_from((c + count / 2) / count.max(1)).unwrap_or(u8::MAX)))
}

/// Two lines above the panel, and the patient's directions beside it.
fn caption(image: &mut RgbImage, subject: &Subject<'_>, camera: &Camera, at: [u32; 2], options: &Options) {
    let width = u32::try_from(camera.size[0]).unwrap_or(u32::MAX);
    let (ink, faint) = (options.theme.ink(), options.theme.faint());
    let mut line = |text: &str, top: u32, largest: u32, colour: Rgb<u8>| {
        let scale = (1..=largest).rev().find(|scale| font::width(text, *scale) <= width).unwrap_or(1);
        let left = at[0] + width.saturating_sub(font::width(text, scale)) / 2;
        font::draw(image, text, [left, top], scale, colour);
    };
    line(&subject.caption, at[1], 3, ink);
    let points = subject.shape.points.len();
    line(&format!("{}, {points} points", camera.view.name()), at[1] + 34, 2, faint);
    let [left, right] = camera.view.sides();
    let middle = at[1] + CAPTION + options.panel_height / 2;
    font::draw(image, &left.to_string(), [at[0], middle], 2, faint);
    font::draw(
        image,
        &right.to_string(),
        [at[0] + width.saturating_sub(font::ADVANCE * 2), middle],
        2,
        faint,
    );
}

/// 50 mm, at the lower left.
fn scale_bar(image: &mut RgbImage, per_mm: f64, bottom: u32, options: &Options) {
    let colour = options.theme.faint();
    let length = pixels(50.0 * per_mm);
    for x in 0..length {
        let is_end = x < 2 || x + 2 >= length;
        for y in 0..if is_end { 10 } else { 2 } {
            if let Some(pixel) = image.get_pixel_mut_checked(MARGIN + x, (bottom - 1).saturating_sub(y)) {
                *pixel = colour;
            }
        }
    }
    font::draw(image, "50 mm", [MARGIN + 6, bottom.saturating_sub(6 + 2 * font::HEIGHT)], 2, colour);
}
