//! The decoded slices, before they become a volume.

use std::borrow::Cow;
use std::ops::Range;

use super::Reading;

/// Pixels along the side of the squares in which a slice is turned over: two of them lie in the
/// processor's nearest cache.
const TILE: usize = 32;

/// Slices in Hounsfield units, one after another, in the order of their places.
pub(in crate::dicom::series) struct Stack<'a> {
    pub(in crate::dicom::series) voxels: &'a [i16],
    /// How each of them was read; none where nothing is known.
    pub(in crate::dicom::series) readings: &'a [Reading],
    pub(in crate::dicom::series) count: usize,
    /// Of the image, as [`columns`](Self::columns).
    pub(in crate::dicom::series) rows: usize,
    pub(in crate::dicom::series) columns: usize,
    /// Whether a slice lies in memory row by row, not column by column.
    pub(in crate::dicom::series) by_rows: bool,
    /// Whether the last row of the image comes first.
    pub(in crate::dicom::series) rows_flipped: bool,
    /// Widest distance of two slices, mm.
    pub(in crate::dicom::series) step_mm: f64,
    /// The same in steps from row to row and from column to column.
    pub(in crate::dicom::series) step_px: [f64; 2],
}

impl Stack<'_> {
    /// The pixels of a slice, row by row.
    pub(super) fn slice(&self, z: usize) -> Cow<'_, [i16]> {
        let size = self.rows * self.columns;
        let stored = &self.voxels[z * size..(z + 1) * size];
        if self.by_rows {
            return Cow::Borrowed(stored);
        }
        let mut turned = vec![0; size];
        for (first_row, rows) in turned.chunks_mut(TILE * self.columns).enumerate() {
            let first_row = first_row * TILE;
            for first_column in (0..self.columns).step_by(TILE) {
                for (r, row) in rows.chunks_exact_mut(self.columns).enumerate() {
                    let end = self.columns.min(first_column + TILE);
                    for (c, pixel) in row[first_column..end].iter_mut().enumerate() {
                        *pixel = stored[(first_column + c) * self.rows + first_row + r];
                    }
                }
            }
        }
        Cow::Owned(turned)
    }

    /// Some of the slices.
    pub(super) fn part(&self, slices: Range<usize>) -> Self {
        let size = self.rows * self.columns;
        let voxels = &self.voxels[slices.start * size..slices.end * size];
        let readings = self.readings.get(slices.clone()).unwrap_or_default();
        Self { voxels, readings, count: slices.len(), ..*self }
    }

    /// How a slice was read, where that is known.
    pub(super) fn reading(&self, z: usize) -> Option<&Reading> {
        self.readings.get(z)
    }

    pub(super) fn pixels(&self) -> f64 {
        (self.rows * self.columns) as f64
    }

    /// Pixels of so many square millimetres.
    pub(super) fn pixels_of(&self, area_mm2: f64) -> f64 {
        area_mm2 * self.step_px[0] * self.step_px[1] / (self.step_mm * self.step_mm)
    }

    /// Rows of the image for rows of the stack.
    pub(super) fn image_rows(&self, rows: &Range<usize>) -> Range<usize> {
        if self.rows_flipped { self.rows - rows.end..self.rows - rows.start } else { rows.clone() }
    }
}
