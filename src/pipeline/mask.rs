//! CT slice to binary mask (paper, section 2.1, Algorithm 1).

use ndarray::ArrayView2;

use super::bitmap::{BLACK, Bitmap, WHITE};
use super::parameters::Parameters;

/// White where `hu_min ≤ HU ≤ hu_max`.
#[must_use]
pub fn mask(slice: ArrayView2<'_, i16>, parameters: &Parameters) -> Bitmap {
    let (height, width) = slice.dim();
    let tissue = parameters.hu_min..=parameters.hu_max;
    let paint = |hu: i16| if tissue.contains(&i32::from(hu)) { WHITE } else { BLACK };
    let mut mask = Bitmap::new(width, height);
    for (row, values) in slice.rows().into_iter().enumerate() {
        for (pixel, &hu) in mask.row_mut(row).iter_mut().zip(values) {
            *pixel = paint(hu);
        }
    }
    mask
}
