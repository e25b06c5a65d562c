//! Pictures of clouds: side by side, from the sides one looks at a head from.
//!
//! | module | what it does |
//! |---|---|
//! | [`View`] | where the viewer stands, in the patient's directions |
//! | [`Colouring`] | what the colours say, and their legend |
//! | `surface` | spacing and normals of points, where the file has none |
//! | `splat` | points as small discs, the nearest one wins |
//! | `shade` | light on them |
//! | `font` | letters |
//! | [`draw`] | panels, captions, legend |
//!
//! Pure; the same input gives the same pixels on any number of threads.

mod colour;
mod font;
mod layout;
mod legend;
mod ramp;
mod shade;
mod splat;
mod surface;
mod theme;
mod view;

use image::{Rgb, RgbImage};

use crate::evaluation::Shape;

pub use colour::Colouring;
pub use layout::draw;
pub use theme::Theme;
pub use view::View;

/// A cloud to draw.
#[derive(Debug)]
pub struct Subject<'a> {
    /// Points in LPS mm; of a mesh, its points are drawn.
    pub shape: &'a Shape,
    /// What stands over its panels.
    pub caption: String,
}

/// How to draw.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// A panel for each, for each cloud.
    pub views: Vec<View>,
    /// What the colours say.
    pub colouring: Colouring,
    /// Where the error's colours end, mm; larger ones look the same.
    pub max_error_mm: f32,
    /// Height of a panel without its caption, pixels.
    pub panel_height: u32,
    /// Colours around the clouds.
    pub theme: Theme,
}

/// Writes a line at the upper edge of a picture, as far as it goes.
pub(crate) fn caption(image: &mut RgbImage, text: &str) {
    font::draw(image, text, [2, 2], 1, Rgb([255, 255, 0]));
}

#[cfg(test)]
mod tests;
