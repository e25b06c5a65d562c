//! Whether Pixel Data (7FE0,0010) is as long as the matrix and the frames say (PS3.5 section 8.1.1
//! and annex A.4).
//!
//! Asked twice: at receipt, of what the header tells, and again when the pixels are decoded.

/// Pixel Data of another size than described.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PixelExtentError {
    /// Native pixel data ends early.
    #[error("the pixel data has {length} bytes; its matrix and frames need {needed}")]
    Short {
        /// Bytes that are there.
        length: u64,
        /// Bytes that must be.
        needed: u64,
    },
    /// Something other than zeros follows the native pixels.
    #[error(
        "the pixel data has {length} bytes, {needed} for its matrix and frames and more that are not zero"
    )]
    Trailing {
        /// Bytes that are there.
        length: u64,
        /// Bytes that must be.
        needed: u64,
    },
    /// Native frames of an odd length, each of which seems to be padded: they must follow each other
    /// without a gap.
    #[error(
        "the pixel data has {length} bytes: a padding byte after each of its {frames} frames, where {needed} bytes \
         without any must be"
    )]
    PaddedFrames {
        /// Bytes that are there.
        length: u64,
        /// Bytes that must be.
        needed: u64,
        /// Frames.
        frames: u32,
    },
    /// A frame has one fragment at least.
    #[error("the compressed pixel data has {fragments} fragments for {frames} frames")]
    Fragments {
        /// Fragments that are not empty.
        fragments: u64,
        /// Frames.
        frames: u32,
    },
}

impl PixelExtentError {
    /// What is there and what must be, in as many characters as an Error Comment holds.
    pub(crate) fn figures(&self) -> String {
        match self {
            Self::Short { length, needed }
            | Self::Trailing { length, needed }
            | Self::PaddedFrames { length, needed, .. } => format!("{length} bytes where {needed} must be"),
            Self::Fragments { fragments, frames } => format!("{fragments} fragments for {frames} frames"),
        }
    }
}

/// What the data set says of its pixels: one sample each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Matrix {
    pub(crate) rows: u16,
    pub(crate) columns: u16,
    pub(crate) frames: u32,
    pub(crate) bits_allocated: u16,
}

impl Matrix {
    /// Bytes of native pixel data. Frames follow each other without a gap.
    fn needed(&self) -> u64 {
        self.pixels()
            .saturating_mul(self.frames.into())
            .saturating_mul(self.bits_allocated.into())
            .div_ceil(8)
    }

    fn pixels(&self) -> u64 {
        u64::from(self.rows) * u64::from(self.columns)
    }

    /// Bytes of native pixel data of that length that follow the pixels, 0 with or without the byte
    /// that pads an odd number of them. Only zeros may.
    pub(crate) fn check_native(&self, length: u64) -> Result<u64, PixelExtentError> {
        let needed = self.needed();
        if length < needed {
            return Err(PixelExtentError::Short { length, needed });
        }
        let surplus = length.saturating_sub(needed.next_multiple_of(2));
        let padded = (self.pixels() + 1).saturating_mul(self.frames.into());
        let seems_padded =
            self.bits_allocated == 8 && self.pixels() % 2 == 1 && self.frames > 1 && length == padded;
        if surplus > 0 && seems_padded {
            return Err(PixelExtentError::PaddedFrames { length, needed, frames: self.frames });
        }
        Ok(surplus)
    }

    /// The error for native pixel data of that length if what follows the pixels is not zero.
    pub(crate) fn trailing(&self, length: u64) -> PixelExtentError {
        PixelExtentError::Trailing { length, needed: self.needed() }
    }

    /// As many fragments as frames, or more.
    pub(crate) fn check_fragments(&self, fragments: u64) -> Result<(), PixelExtentError> {
        if fragments < self.frames.into() {
            return Err(PixelExtentError::Fragments { fragments, frames: self.frames });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_byte_may_pad_and_more_is_told() {
        let matrix = |columns, frames, bits_allocated| Matrix { rows: 3, columns, frames, bits_allocated };
        let short = |length, needed| Err(PixelExtentError::Short { length, needed });
        for (matrix, length, expected) in [
            (matrix(4, 1, 16), 23, short(23, 24)),
            (matrix(4, 1, 16), 24, Ok(0)),
            (matrix(4, 1, 16), 25, Ok(1)),
            (matrix(4, 1, 16), 26, Ok(2)),
            (matrix(4, 5, 16), 118, short(118, 120)),
            (matrix(3, 1, 8), 8, short(8, 9)),
            (matrix(3, 1, 8), 9, Ok(0)),
            (matrix(3, 1, 8), 10, Ok(0)),
            (matrix(3, 1, 8), 12, Ok(2)),
            (matrix(3, 3, 8), 28, Ok(0)),
            (matrix(3, 3, 8), 30, Err(PixelExtentError::PaddedFrames { length: 30, needed: 27, frames: 3 })),
            (matrix(3, 2, 8), 20, Err(PixelExtentError::PaddedFrames { length: 20, needed: 18, frames: 2 })),
            (matrix(4, 3, 8), 36, Ok(0)),
            (matrix(3, 1, 1), 2, Ok(0)),
        ] {
            assert_eq!(matrix.check_native(length), expected, "{matrix:?} {length}");
        }
        let most = Matrix { rows: u16::MAX, columns: u16::MAX, frames: u32::MAX, bits_allocated: u16::MAX };
        assert!(most.check_native(u64::from(u32::MAX)).is_err());
    }
}
