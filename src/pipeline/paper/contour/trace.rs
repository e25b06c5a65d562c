//! External contours of a picture: every border pixel, 8-connected.
//!
//! Border following after Suzuki and Abe, *Topological Structural Analysis of Digitized Binary
//! Images by Border Following*, CVGIP 30 (1985), outermost borders only: what the paper's OpenCV
//! does with `RETR_EXTERNAL` and `CHAIN_APPROX_NONE`.

use crate::pipeline::paper::bitmap::{BLACK, Bitmap, WHITE};
use crate::pipeline::slices::Pixel;

/// On a border, with the component's inside or another border pixel to the right.
pub(super) const BORDER: u8 = 2;
/// On a border, with the outside to the right.
pub(super) const EXIT: u8 = 3;

/// The outermost borders of the white components, each in the order in which the border is
/// followed, a pixel as often as it is passed.
///
/// The border pixels stay marked in the picture (`BORDER`, `EXIT`).
#[must_use]
pub fn external_contours(picture: &mut Bitmap) -> Vec<Vec<Pixel>> {
    let (width, height, stride) = (picture.width(), picture.height(), picture.stride());
    let mut contours = Vec::new();
    for row in 0..height {
        let start = picture.offset(row, 0);
        let pixels = picture.framed();
        let mut left = BLACK;
        let mut inside = false;
        for column in 0..width {
            let mut here = pixels[start + column];
            if here == WHITE && left == BLACK && !inside {
                contours.push(follow(pixels, stride, row, column));
                here = pixels[start + column];
            }
            match here {
                BORDER => inside = true,
                EXIT => inside = false,
                _ => {}
            }
            left = here;
        }
    }
    contours
}

/// The border that starts at a pixel whose left neighbour lies outside the component.
fn follow(pixels: &mut [u8], stride: usize, row: usize, column: usize) -> Vec<Pixel> {
    const WEST: usize = 4;
    let compass = Compass::new(stride);
    let start = (row + 1) * stride + column + 1;
    let Some(first_direction) = compass.clockwise(pixels, start, WEST) else {
        pixels[start] = EXIT;
        return vec![pixel(start, stride)];
    };
    let last = compass.step(start, first_direction);

    let mut border = Vec::new();
    let mut here = start;
    let mut back = first_direction;
    loop {
        let (next, right_is_outside) = compass.counter_clockwise(pixels, here, back);
        if right_is_outside {
            pixels[here] = EXIT;
        } else if pixels[here] == WHITE {
            pixels[here] = BORDER;
        }
        border.push(pixel(here, stride));
        let there = compass.step(here, next);
        if there == start && here == last {
            return border;
        }
        here = there;
        back = (next + 4) % 8;
    }
}

#[expect(clippy::cast_possible_truncation, reason = "a picture is far smaller than 2^32 pixels a side")]
fn pixel(offset: usize, stride: usize) -> Pixel {
    Pixel { row: (offset / stride - 1) as u32, column: (offset % stride - 1) as u32 }
}

/// The eight neighbours, counter-clockwise from the right.
struct Compass {
    offsets: [isize; 8],
}

impl Compass {
    fn new(stride: usize) -> Self {
        let down = stride.cast_signed();
        Self { offsets: [1, 1 - down, -down, -1 - down, -1, down - 1, down, down + 1] }
    }

    fn step(&self, from: usize, direction: usize) -> usize {
        from.wrapping_add_signed(self.offsets[direction])
    }

    /// The first white neighbour clockwise from (but not at) `from_direction`.
    fn clockwise(&self, pixels: &[u8], here: usize, from_direction: usize) -> Option<usize> {
        (1..8).map(|turn| (from_direction + 8 - turn) % 8).find(|&d| pixels[self.step(here, d)] != BLACK)
    }

    /// The first white neighbour counter-clockwise after `back`, where there is one; and whether
    /// the right neighbour was passed on the way and is black.
    fn counter_clockwise(&self, pixels: &[u8], here: usize, back: usize) -> (usize, bool) {
        let mut right_is_outside = false;
        for turn in 1..8 {
            let direction = (back + turn) % 8;
            if pixels[self.step(here, direction)] != BLACK {
                return (direction, right_is_outside);
            }
            right_is_outside |= direction == 0;
        }
        (back, right_is_outside)
    }
}
