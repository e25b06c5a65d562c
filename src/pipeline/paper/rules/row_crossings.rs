//! How often a row crosses the contour (paper, Figure 1, "pixel counting filter").

use crate::pipeline::paper::bitmap::{Bitmap, CONTOUR};

/// Contour pixels of a row from column `from` to the left, counting only those at least `gap`
/// columns left of the last one that was counted.
pub(super) fn crossings(picture: &Bitmap, row: usize, from: usize, gap: usize) -> usize {
    let mut last: Option<usize> = None;
    let mut count = 0;
    for (column, &pixel) in picture.row(row).iter().enumerate().take(from + 1).rev() {
        if pixel == CONTOUR && last.is_none_or(|last| last - column >= gap) {
            last = Some(column);
            count += 1;
        }
    }
    count
}
