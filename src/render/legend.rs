//! What the colours mean, in a row below the panels.

use image::{Rgb, RgbImage};

use super::colour::{UNKNOWN, direction_colour, directions, plane_colour};
use super::ramp::ramp;
use super::{Colouring, Options, Subject, font};
use crate::geometry::{Plane, PlaneSet};

/// Edge of a swatch of colour, pixels.
const SWATCH: u32 = 20;
/// Length of a ramp, pixels.
const RAMP: u32 = 300;

/// A piece of the legend.
enum Item {
    Text(String),
    Swatch([f32; 3]),
    Ramp,
    Gap,
}

impl Item {
    fn width(&self, scale: u32) -> u32 {
        match self {
            Self::Text(text) => font::width(text, scale),
            Self::Swatch(_) => SWATCH,
            Self::Ramp => RAMP,
            Self::Gap => 12,
        }
    }
}

/// The legend of a picture.
pub(super) struct Legend(Vec<Item>);

impl Legend {
    /// `heights` are the ends of the ramp along the patient's axis, mm.
    pub(super) fn new(subjects: &[Subject<'_>], heights: [f64; 2], options: &Options) -> Self {
        let mut items = Vec::new();
        let text = |text: &str| Item::Text(text.to_owned());
        let ramp = |low: String, high: String, what: &str| {
            [text(what), Item::Gap, Item::Text(low), Item::Ramp, Item::Text(high)]
        };
        match options.colouring {
            Colouring::Error => {
                let high = format!("{} mm or more", options.max_error_mm);
                items.extend(ramp("0".to_owned(), high, "stated error"));
            }
            Colouring::Height => {
                let [low, high] = heights.map(|mm| format!("{mm:.0} mm"));
                items.extend(ramp(low, high, "superior"));
            }
            Colouring::Plane => {
                items.push(text("planes"));
                for (planes, name) in sets().into_iter().filter(|(planes, _)| is_there(subjects, *planes)) {
                    items.extend([Item::Gap, Item::Swatch(plane_colour(planes)), Item::Text(name)]);
                }
            }
            Colouring::Normal => {
                items.push(text("normal to"));
                for (name, direction) in directions() {
                    items.extend([Item::Gap, Item::Swatch(direction_colour(direction)), text(name)]);
                }
            }
        }
        let lacks = |name: &str| subjects.iter().any(|subject| subject.shape.property(name).is_none());
        if options.colouring.property().is_some_and(lacks) {
            items.extend([Item::Gap, Item::Swatch(UNKNOWN), text("the file does not say")]);
        }
        Self(items)
    }

    fn width(&self, scale: u32) -> u32 {
        self.0.iter().map(|item| item.width(scale) + 8).sum()
    }

    /// Draws it with its middle at `middle` and its top at `top`, as large as fits.
    pub(super) fn draw(&self, image: &mut RgbImage, middle: u32, top: u32, ink: Rgb<u8>) {
        let scale = if self.width(2) <= image.width() { 2 } else { 1 };
        let mut left = middle.saturating_sub(self.width(scale) / 2);
        let text_top = top + (SWATCH - 7 * scale) / 2;
        for item in &self.0 {
            match item {
                Item::Text(text) => font::draw(image, text, [left, text_top], scale, ink),
                Item::Swatch(colour) => {
                    fill(image, [left, top], SWATCH, |_| byte(*colour));
                }
                Item::Ramp => fill(image, [left, top], RAMP, |x| byte(ramp(x as f32 / (RAMP - 1) as f32))),
                Item::Gap => {}
            }
            left += item.width(scale) + 8;
        }
    }
}

/// Height of the legend, pixels.
pub(super) const HEIGHT: u32 = SWATCH;

fn fill(image: &mut RgbImage, [left, top]: [u32; 2], width: u32, colour: impl Fn(u32) -> Rgb<u8>) {
    for x in 0..width {
        for y in 0..SWATCH {
            if let Some(pixel) = image.get_pixel_mut_checked(left + x, top + y) {
                *pixel = colour(x);
            }
        }
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn byte(colour: [f32; 3]) -> Rgb<u8> {
    Rgb(colour.map(|c| c as u8))
}

/// All sets of planes with their names.
fn sets() -> Vec<(PlaneSet, String)> {
    let all = |bits: u8| {
        let planes = PlaneSet::from_bits(bits);
        let names: Vec<_> =
            Plane::ALL.into_iter().filter(|plane| planes.contains(*plane)).map(Plane::name).collect();
        (planes, if names.len() == 3 { "all three".to_owned() } else { names.join(" + ") })
    };
    [1, 2, 4, 3, 5, 6, 7].map(all).to_vec()
}

/// Whether a point of that set is drawn.
fn is_there(subjects: &[Subject<'_>], planes: PlaneSet) -> bool {
    let values = |subject: &Subject<'_>| {
        let planes = f32::from(planes.bits());
        subject.shape.property("planes").is_some_and(|values| values.contains(&planes))
    };
    subjects.iter().any(values)
}
