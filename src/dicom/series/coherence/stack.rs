//! The decoded slices, before they become a volume.

use std::borrow::Cow;
use std::ops::Range;

/// Slices in Hounsfield units, one after another, in the order of their places.
pub(in crate::dicom::series) struct Stack<'a> {
    pub(in crate::dicom::series) voxels: &'a [i16],
    pub(in crate::dicom::series) count: usize,
    /// Of the image, as [`columns`](Self::columns).
    pub(in crate::dicom::series) rows: usize,
    pub(in crate::dicom::series) columns: usize,
    /// Whether a slice lies in memory row by row, not column by column.
    pub(in crate::dicom::series) by_rows: bool,
    /// Whether the last row of the image comes first.
    pub(in crate::dicom::series) rows_flipped: bool,
    /// Widest distance of two slices, in steps from row to row and from column to column.
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
        let row = |r: usize| (0..self.columns).map(move |c| stored[c * self.rows + r]);
        Cow::Owned((0..self.rows).flat_map(row).collect())
    }

    /// Some of the slices.
    pub(super) fn part(&self, slices: Range<usize>) -> Self {
        let size = self.rows * self.columns;
        let voxels = &self.voxels[slices.start * size..slices.end * size];
        Self { voxels, count: slices.len(), ..*self }
    }

    pub(super) fn pixels(&self) -> f64 {
        (self.rows * self.columns) as f64
    }

    /// Rows of the image for rows of the stack.
    pub(super) fn image_rows(&self, rows: &Range<usize>) -> Range<usize> {
        if self.rows_flipped { self.rows - rows.end..self.rows - rows.start } else { rows.clone() }
    }
}
