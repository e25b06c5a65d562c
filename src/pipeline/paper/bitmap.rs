//! A black-and-white picture.

use crate::pipeline::slices::Pixel;

/// Background.
pub(crate) const BLACK: u8 = 0;
/// Foreground.
pub(crate) const WHITE: u8 = 1;
/// Foreground, and on the contour.
pub(crate) const CONTOUR: u8 = 2;

/// A black-and-white picture in which pixels can also be marked as lying on the contour.
///
/// One byte a pixel, with a black frame of one pixel around it, so that border following never has
/// to ask whether a neighbour exists.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Bitmap {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

impl Bitmap {
    /// A black picture of `width` columns and `height` rows.
    #[must_use]
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![BLACK; (width + 2) * (height + 2)] }
    }

    /// Columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Whether the pixel is white (marked ones are).
    ///
    /// # Panics
    /// If the pixel lies outside the picture.
    #[must_use]
    pub fn is_white(&self, row: usize, column: usize) -> bool {
        self.row(row)[column] != BLACK
    }

    /// Paints a pixel white.
    ///
    /// # Panics
    /// If the pixel lies outside the picture.
    pub fn set_white(&mut self, row: usize, column: usize) {
        self.row_mut(row)[column] = WHITE;
    }

    /// One row, without the frame: 0 is black.
    pub(crate) fn row(&self, row: usize) -> &[u8] {
        let start = self.offset(row, 0);
        &self.pixels[start..start + self.width]
    }

    /// One row, without the frame.
    pub(crate) fn row_mut(&mut self, row: usize) -> &mut [u8] {
        let start = self.offset(row, 0);
        &mut self.pixels[start..start + self.width]
    }

    /// White pixels of a row.
    pub(crate) fn white_in_row(&self, row: usize) -> usize {
        self.row(row).iter().filter(|&&p| p != BLACK).count()
    }

    /// Marks the pixels as lying on the contour.
    pub(crate) fn mark(&mut self, contour: &[Pixel]) {
        for pixel in contour {
            self.row_mut(pixel.row as usize)[pixel.column as usize] = CONTOUR;
        }
    }

    /// The pixels with their frame, for border following.
    pub(super) fn framed(&mut self) -> &mut [u8] {
        &mut self.pixels
    }

    /// Distance between two rows in [`Bitmap::framed`].
    pub(super) fn stride(&self) -> usize {
        self.width + 2
    }

    /// Where a pixel stands in [`Bitmap::framed`].
    pub(super) fn offset(&self, row: usize, column: usize) -> usize {
        (row + 1) * self.stride() + column + 1
    }
}
