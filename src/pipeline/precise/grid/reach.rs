//! Which cells lie within reach of marked ones: dilation by a ball, 64 cells at a time.

use std::iter;

use rayon::prelude::*;

use super::bit_rows::{BitRows, WORD};
use crate::observer::stop::Asked;

/// Whether a marked cell lies within the square root of `limit` cells of each cell, from centre to
/// centre. `shape` is `[nx, ny, nz]`, x fastest.
///
/// The ball is a stack of rows: each row of the result is the union of the rows around it, each
/// widened by what is left of the reach there. The time grows with the square of the reach; no structure of
/// the data can make it slow.
pub(crate) fn within(
    asked: Asked<'_>,
    shape: [usize; 3],
    limit: u16,
    marked: impl Fn(usize) -> bool + Sync,
) -> Vec<bool> {
    let [nx, ny, nz] = shape;
    let first = BitRows::by(asked, [nx, ny * nz], marked);
    let held: Vec<bool> = (0..ny * nz).map(|row| first.row(row).iter().any(|word| *word != 0)).collect();
    let reach = usize::from(limit.isqrt());
    let widened: Vec<BitRows> =
        iter::successors(Some(first), |last| Some(last.widened(asked))).take(reach + 1).collect();
    let ball = ball(limit);
    let union = |row: usize, union: &mut [u64]| {
        let (y, z) = (row % ny, row / ny);
        union.fill(0);
        for &(dy, dz, width) in &ball {
            let (y, z) = (y.checked_add_signed(dy), z.checked_add_signed(dz));
            let (Some(y), Some(z)) = (y.filter(|y| *y < ny), z.filter(|z| *z < nz)) else { continue };
            if held[z * ny + y] {
                let other = widened[width].row(z * ny + y);
                union.iter_mut().zip(other).for_each(|(u, o)| *u |= o);
            }
        }
    };
    let mut near = vec![false; nx * ny * nz];
    let rows = near.par_chunks_mut(nx).enumerate().panic_fuse();
    rows.for_each_init(
        || vec![0; nx.div_ceil(WORD)],
        |words, (row, near)| {
            asked.ask_at(row);
            union(row, words);
            for (near, word) in near.chunks_mut(WORD).zip(&*words) {
                near.iter_mut().enumerate().for_each(|(bit, near)| *near = word >> bit & 1 == 1);
            }
        },
    );
    near
}

/// The rows of a ball as steps along y and z, with how far each reaches to both sides along x.
fn ball(limit: u16) -> Vec<(isize, isize, usize)> {
    let reach = limit.isqrt() as isize;
    let rows = (-reach..=reach).flat_map(|dz| (-reach..=reach).map(move |dy| (dy, dz)));
    let with_width = |(dy, dz): (isize, isize)| {
        let left = usize::from(limit).checked_sub((dy * dy + dz * dz) as usize)?;
        Some((dy, dz, left.isqrt()))
    };
    rows.filter_map(with_width).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_trying_all_cells() {
        for (shape, limit) in [([131, 7, 5], 16), ([64, 6, 4], 6), ([3, 9, 1], 0), ([70, 1, 8], 70)] {
            let [nx, ny, nz] = shape;
            let marked = |i: usize| (i * 7919) % 197 == 3;
            let found = within(Asked::default(), shape, limit, marked);
            let at = |i: usize| [i % nx, i / nx % ny, i / (nx * ny)];
            let distance =
                |i: usize, j: usize| (0..3).map(|a| at(i)[a].abs_diff(at(j)[a]).pow(2)).sum::<usize>();
            for i in 0..nx * ny * nz {
                let truth = (0..found.len()).any(|j| marked(j) && distance(i, j) <= usize::from(limit));
                assert_eq!(found[i], truth, "at {:?} of {shape:?} within √{limit}", at(i));
            }
        }
    }
}
