//! Noise as a reconstruction kernel leaves it: neighbouring pixels have some of it in common.

use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;

/// Standard deviation that the 3 × 3 binomial filter leaves of white noise of 1: 6/16.
const LEFT_BY_FILTER: f32 = 0.375;

/// Adds noise of standard deviation `hu` to the `columns`-wide image of one slice. Depends on
/// seed and slice alone, not on the order in which slices are made.
pub(super) fn add(image: &mut [f32], columns: usize, hu: f64, seed: u64, slice: usize) {
    let slice = u64::try_from(slice).expect("a slice's number fits in 64 bits");
    let mut random = Pcg64Mcg::seed_from_u64(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(slice));
    #[expect(clippy::cast_possible_truncation)]
    let amplitude = hu as f32 / LEFT_BY_FILTER;
    let rows = image.len() / columns;
    // One pixel more on each side, so that the border is filtered like the rest.
    let width = columns + 2;
    let mut white: Vec<f32> = StandardNormal.sample_iter(&mut random).take(width * (rows + 2)).collect();
    for row in white.chunks_exact_mut(width) {
        for x in 0..columns {
            row[x] = 0.25 * row[x] + 0.5 * row[x + 1] + 0.25 * row[x + 2];
        }
    }
    for (y, line) in image.chunks_exact_mut(columns).enumerate() {
        for (x, pixel) in line.iter_mut().enumerate() {
            let at = y * width + x;
            let noise = 0.25 * white[at] + 0.5 * white[at + width] + 0.25 * white[at + 2 * width];
            *pixel += amplitude * noise;
        }
    }
}
