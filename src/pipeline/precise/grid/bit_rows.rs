//! A mask of cells or voxels, a bit each: rows along x in words of 64, so that a whole word is
//! searched at once.

use rayon::prelude::*;

use crate::observer::stop::Asked;

/// Bits in a word.
pub(crate) const WORD: usize = u64::BITS as usize;
/// At least so many rows at a time.
const AT_ONCE: usize = 64;

/// Rows of bits, the lowest one first; beyond the end of a row they are no cells.
#[derive(Debug)]
pub(crate) struct BitRows {
    words: usize,
    bits: Vec<u64>,
}

impl BitRows {
    /// `[nx, rows]` cells: those whose offset (x fastest) is `marked`.
    pub(crate) fn by(
        asked: Asked<'_>,
        [nx, rows]: [usize; 2],
        marked: impl Fn(usize) -> bool + Sync,
    ) -> Self {
        Self::filled(asked, [nx, rows], |start, flags| {
            flags.iter_mut().enumerate().for_each(|(i, flag)| *flag = u8::from(marked(start + i)));
        })
    }

    /// Rows of `nx` cells: those whose value is `marked`.
    pub(crate) fn of<T: Sync>(
        asked: Asked<'_>,
        nx: usize,
        values: &[T],
        marked: impl Fn(&T) -> bool + Sync,
    ) -> Self {
        Self::filled(asked, [nx, values.len() / nx], |start, flags| {
            flags.iter_mut().zip(&values[start..]).for_each(|(flag, v)| *flag = u8::from(marked(v)));
        })
    }

    /// `flag` gets the offset of the first of up to 64 cells and sets those that are marked to 1.
    fn filled(asked: Asked<'_>, [nx, rows]: [usize; 2], flag: impl Fn(usize, &mut [u8]) + Sync) -> Self {
        let words = nx.div_ceil(WORD);
        let mut bits = vec![0; words * rows];
        let each = bits.par_chunks_mut(words).enumerate().with_min_len(AT_ONCE).panic_fuse();
        each.for_each(|(row, bits)| {
            asked.ask_at(row);
            for (k, word) in bits.iter_mut().enumerate() {
                let mut flags = [0; WORD];
                flag(row * nx + k * WORD, &mut flags[..WORD.min(nx - k * WORD)]);
                *word = packed(&flags);
            }
        });
        Self { words, bits }
    }

    /// The words of a row.
    #[inline]
    pub(crate) fn row(&self, row: usize) -> &[u64] {
        &self.bits[row * self.words..][..self.words]
    }

    /// Every row widened by a cell to both sides.
    pub(crate) fn widened(&self, asked: Asked<'_>) -> Self {
        let mut bits = vec![0; self.bits.len()];
        let each = bits.par_chunks_mut(self.words).zip(self.bits.par_chunks(self.words));
        each.with_min_len(AT_ONCE).enumerate().panic_fuse().for_each(|(number, (out, row))| {
            asked.ask_at(number);
            for (k, out) in out.iter_mut().enumerate() {
                let before = k.checked_sub(1).map_or(0, |j| row[j] >> (WORD - 1));
                let after = row.get(k + 1).map_or(0, |w| w << (WORD - 1));
                *out = row[k] | row[k] << 1 | row[k] >> 1 | before | after;
            }
        });
        Self { words: self.words, bits }
    }
}

/// A bit for each flag, all of which are 0 or 1.
fn packed(flags: &[u8; WORD]) -> u64 {
    // Eight flags are gathered in the product's highest byte: flag i, at bit 8 i, meets 2^(56 - 7 i).
    const GATHER: u64 = 0x0102_0408_1020_4080;
    let (bytes, _) = flags.as_chunks::<8>();
    let byte = |flags: &[u8; 8]| u64::from_le_bytes(*flags).wrapping_mul(GATHER) >> 56;
    bytes.iter().rev().fold(0, |word, flags| word << 8 | byte(flags))
}

/// The places of the bits that are set in words, in order.
pub(crate) fn ones(words: impl IntoIterator<Item = u64>) -> impl Iterator<Item = usize> {
    words.into_iter().enumerate().flat_map(|(k, mut word)| {
        std::iter::from_fn(move || {
            let bit = (word != 0).then(|| word.trailing_zeros() as usize)?;
            word &= word - 1;
            Some(k * WORD + bit)
        })
    })
}

/// The places in a row whose bit differs from the next one's, in order.
pub(crate) fn steps(words: &[u64], nx: usize) -> impl Iterator<Item = usize> {
    let next = |k: usize| words[k] >> 1 | words.get(k + 1).map_or(0, |word| word << (WORD - 1));
    ones((0..words.len()).map(move |k| words[k] ^ next(k))).take_while(move |x| x + 1 < nx)
}

/// The first place from `from` on whose bit is `set`, if it comes before `end`; else `end`.
#[inline]
pub(crate) fn next(words: &[u64], from: usize, end: usize, set: bool) -> usize {
    let mut covered = u64::MAX << (from % WORD);
    for (k, word) in words.iter().enumerate().skip(from / WORD) {
        let found = (if set { *word } else { !*word }) & covered;
        if found != 0 {
            return end.min(k * WORD + found.trailing_zeros() as usize);
        }
        covered = u64::MAX;
    }
    end
}

#[cfg(test)]
mod tests {
    use super::*;

    const MARKED: fn(usize) -> bool = |i| (i * 7919) % 13 < 5;

    /// Rows that end before, at and after the end of a word.
    #[test]
    fn every_cell_has_its_bit() {
        for nx in [1, 7, 63, 64, 65, 130] {
            let offsets: Vec<usize> = (0..nx * 3).collect();
            let (by, of) = (
                BitRows::by(Asked::default(), [nx, 3], MARKED),
                BitRows::of(Asked::default(), nx, &offsets, |&i| MARKED(i)),
            );
            for row in 0..3 {
                let expected: Vec<usize> = (0..nx).filter(|x| MARKED(row * nx + x)).collect();
                for rows in [&by, &of] {
                    assert_eq!(ones(rows.row(row).iter().copied()).collect::<Vec<_>>(), expected, "{nx}");
                }
                let changed = |&x: &usize| MARKED(row * nx + x) != MARKED(row * nx + x + 1);
                let changes: Vec<usize> = (0..nx - 1).filter(changed).collect();
                assert_eq!(steps(by.row(row), nx).collect::<Vec<_>>(), changes, "{nx}");
                for x in 0..nx {
                    for set in [true, false] {
                        let first = (x..nx).find(|&x| MARKED(row * nx + x) == set).unwrap_or(nx);
                        assert_eq!(next(by.row(row), x, nx, set), first, "from {x} of {nx}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_row_is_widened_past_the_end_of_a_word() {
        let rows = BitRows::by(Asked::default(), [130, 1], |i| matches!(i, 0 | 63 | 100 | 128))
            .widened(Asked::default());
        let near: Vec<usize> = ones(rows.row(0).iter().copied()).take_while(|&x| x < 130).collect();
        assert_eq!(near, [0, 1, 62, 63, 64, 99, 100, 101, 127, 128, 129]);
    }
}
