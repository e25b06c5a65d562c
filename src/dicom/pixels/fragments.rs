//! Which fragments make up which frame (PS3.5 section A.4).

use std::borrow::Cow;

use super::PixelError;

/// Fragments and the tables that say where frames begin.
pub(super) struct Layout<'a> {
    /// Basic Offset Table: 32-bit offsets, or empty.
    pub(super) offset_table: &'a [u8],
    /// Extended Offset Table (7FE0,0001): 64-bit offsets, or empty.
    pub(super) extended_offset_table: &'a [u8],
    /// Offset and bytes of each fragment.
    pub(super) fragments: Vec<(u64, &'a [u8])>,
}

impl<'a> Layout<'a> {
    /// The bytes of each of `count` frames.
    ///
    /// A table counts if it has an offset for each frame that is the offset of a fragment (real
    /// files have wrong ones). Without a table, as many fragments as frames are the frames;
    /// otherwise a frame begins with each fragment that begins like a compressed stream.
    pub(super) fn frames(self, count: u32) -> Result<Vec<Cow<'a, [u8]>>, PixelError> {
        let count = usize::try_from(count).unwrap_or(usize::MAX);
        if count == 1 {
            return Ok(vec![joined(&self.fragments)]);
        }
        let starts = self
            .starts_by_table(numbers::<8>(self.extended_offset_table), count)
            .or_else(|| self.starts_by_table(numbers::<4>(self.offset_table), count))
            .or_else(|| (self.fragments.len() == count).then(|| (0..count).collect()))
            .or_else(|| self.starts_by_content(count));
        let Some(starts) = starts else {
            return Err(PixelError::Decode(format!(
                "its {} fragments can't be told apart into {count} frames",
                self.fragments.len()
            )));
        };
        let ends = starts.iter().skip(1).copied().chain([self.fragments.len()]);
        Ok(starts.iter().zip(ends).map(|(start, end)| joined(&self.fragments[*start..end])).collect())
    }

    /// Index of the first fragment of each frame, if every offset is that of a fragment, in order.
    fn starts_by_table(&self, offsets: Vec<u64>, count: usize) -> Option<Vec<usize>> {
        if offsets.len() != count || !offsets.is_sorted_by(|a, b| a < b) || offsets.first() != Some(&0) {
            return None;
        }
        offsets.iter().map(|offset| self.fragments.binary_search_by_key(offset, |(o, _)| *o).ok()).collect()
    }

    fn starts_by_content(&self, count: usize) -> Option<Vec<usize>> {
        let starts: Vec<usize> =
            (0..self.fragments.len()).filter(|i| begins_a_stream(self.fragments[*i].1)).collect();
        (starts.len() == count && starts.first() == Some(&0)).then_some(starts)
    }
}

/// Start of image of JPEG and JPEG-LS, or start of codestream and its size of JPEG 2000.
fn begins_a_stream(fragment: &[u8]) -> bool {
    fragment.starts_with(&[0xFF, 0xD8, 0xFF]) || fragment.starts_with(&[0xFF, 0x4F, 0xFF, 0x51])
}

fn joined<'a>(fragments: &[(u64, &'a [u8])]) -> Cow<'a, [u8]> {
    match fragments {
        [(_, only)] => Cow::Borrowed(only),
        several => Cow::Owned(several.iter().flat_map(|(_, bytes)| *bytes).copied().collect()),
    }
}

/// Little-endian numbers of `N` bytes.
fn numbers<const N: usize>(table: &[u8]) -> Vec<u64> {
    table
        .chunks_exact(N)
        .map(|chunk| chunk.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte)))
        .collect()
}
