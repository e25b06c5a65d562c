//! Stored values from allocated words: the bits of the sample, and what the bits around it are
//! (PS3.5 section 8.1.1).
//!
//! A word may have more bits than BitsStored. They are, and don't count:
//! - zeros;
//! - above a signed sample, copies of its sign;
//! - an overlay plane that OverlayBitPosition (60xx,0102) announces there (PS3.5 section 8.1.2, as it
//!   was until 2004);
//! - the whole word, where it is that of PixelPaddingValue: such a pixel has that value.
//!
//! Other set bits are masked, and counted for a warning, if they can only be flags beside the
//! sample. They may as well belong to the value, and the frame is refused, if
//! - the lowest bit above the sample is among them: the sample may have more bits than it says, or a
//!   sign that it does not say;
//! - they lie below the sample: HighBit may be wrong;
//! - every word has some: the values may have an offset;
//! - all words that have some are the same: a special value, not a flag.

use super::{Format, PixelError};

/// Which bits of a word are what.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Words {
    bits_stored: u16,
    shift: u16,
    signed: bool,
    allocated: u16,
    /// Bits above the sample that no overlay is announced in.
    above: u16,
    /// Bits below the sample, likewise.
    below: u16,
    /// The word of PixelPaddingValue, if it is one with bits beyond the sample.
    padding: Option<u16>,
}

/// Values with the number of them that lost bits around the sample.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Stored {
    /// Row by row, with their sign.
    pub(crate) values: Vec<i32>,
    /// Values whose word had other bits set, which were masked.
    pub(crate) masked: u64,
    /// By how many bytes a block of the compressed frame ended before or after its data: 0 to 2 if
    /// nothing is wrong with them.
    pub(crate) off_its_end: u32,
}

/// The words that had other bits set.
#[derive(Default)]
struct Strays {
    count: u64,
    bits: u16,
    first: Option<u16>,
    differ: bool,
    /// One looks like a negative value whose sign goes on above it.
    like_signed: bool,
}

impl Words {
    /// Of pixels of that format, with overlays at these bits and that padding value.
    pub(super) fn new(format: &Format, overlays: &[u16], padding: Option<u16>) -> Self {
        let shift = format.high_bit + 1 - format.bits_stored;
        let allocated = u16::MAX >> (16 - format.bits_allocated);
        let sample = (u16::MAX >> (16 - format.bits_stored)) << shift;
        let announced = overlays.iter().filter(|bit| **bit < 16).fold(0, |bits, bit| bits | 1 << bit);
        let around = allocated & !sample & !announced;
        let below = around & ((sample & sample.wrapping_neg()) - 1);
        let mut words = Self {
            bits_stored: format.bits_stored,
            shift,
            signed: format.signed,
            allocated,
            above: around & !below,
            below,
            padding: None,
        };
        words.padding = padding.map(|word| word & allocated).filter(|word| words.strays(*word) != 0);
        words
    }

    /// The values of words, or why they are in doubt.
    pub(super) fn values(&self, words: impl Iterator<Item = u16>) -> Result<Stored, PixelError> {
        let mut strays = Strays::default();
        let values: Vec<i32> = words.map(|word| self.value(word, &mut strays)).collect();
        self.judge(&strays, values.len() as u64)?;
        Ok(Stored { values, masked: strays.count, off_its_end: 0 })
    }

    fn value(&self, word: u16, strays: &mut Strays) -> i32 {
        let stray = self.strays(word);
        if stray != 0 {
            if self.padding == Some(word) {
                return self.padding_value(word);
            }
            strays.count += 1;
            strays.bits |= stray;
            strays.differ |= *strays.first.get_or_insert(word) != word;
            strays.like_signed |=
                !self.signed && self.above != 0 && stray & self.above == self.above && self.is_high(word);
        }
        let unused = 16 - self.bits_stored;
        let sample = (word >> self.shift) << unused;
        if self.signed { i32::from(sample.cast_signed() >> unused) } else { i32::from(sample >> unused) }
    }

    /// The set bits around the sample that are neither announced nor its sign.
    fn strays(&self, word: u16) -> u16 {
        let above = word & self.above;
        let is_sign = self.signed && above == self.above && self.is_high(word);
        (if is_sign { 0 } else { above }) | (word & self.below)
    }

    /// Whether the highest bit of the sample is set.
    fn is_high(&self, word: u16) -> bool {
        word >> (self.shift + self.bits_stored - 1) & 1 == 1
    }

    /// PixelPaddingValue as a number.
    fn padding_value(&self, word: u16) -> i32 {
        match (self.signed, self.allocated) {
            (true, 0xFF) => i32::from((word as u8).cast_signed()),
            (true, _) => i32::from(word.cast_signed()),
            (false, _) => i32::from(word),
        }
    }

    fn judge(&self, strays: &Strays, words: u64) -> Result<(), PixelError> {
        let lowest_above = self.above & self.above.wrapping_neg();
        let doubt = if strays.count == 0 {
            return Ok(());
        } else if strays.like_signed {
            "its values look signed, which PixelRepresentation (0028,0103) says they are not"
        } else if strays.bits & lowest_above != 0 {
            "its values may have more bits than BitsStored (0028,0101) says"
        } else if strays.bits & self.below != 0 {
            "HighBit (0028,0102) may be wrong"
        } else if strays.count == words {
            "its values may have an offset, for every one has some"
        } else if !strays.differ {
            "they may mark one special value"
        } else {
            return Ok(());
        };
        Err(PixelError::Decode(format!(
            "{} of its {words} pixels have bits set outside the {} bits stored (mask {:04X}), and no overlay is \
             announced there: {doubt}",
            strays.count, self.bits_stored, strays.bits
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(stored: u16, high_bit: u16, signed: bool, overlays: &[u16], padding: Option<u16>) -> Words {
        let format = Format {
            rows: 1,
            columns: 1,
            frames: 1,
            photometric: String::new(),
            bits_allocated: 16,
            bits_stored: stored,
            high_bit,
            signed,
        };
        Words::new(&format, overlays, padding)
    }

    fn read(words: Words, of: &[u16]) -> Result<(Vec<i32>, u64), PixelError> {
        words.values(of.iter().copied()).map(|stored| (stored.values, stored.masked))
    }

    #[test]
    fn sign_extension_and_announced_overlays_do_not_count() {
        let signed = words(12, 11, true, &[], None);
        assert_eq!(read(signed, &[0xFC18, 0x0C18, 0x03E8]), Ok((vec![-1000, -1000, 1000], 0)));
        let overlay = words(12, 11, true, &[12, 15], None);
        assert_eq!(
            read(overlay, &[0xFC18, 0x9C18, 0x6C18, 0x13E8]),
            Ok((vec![-1000, -1000, -1000, 1000], 0))
        );
        let high = words(12, 15, false, &[0], None);
        assert_eq!(read(high, &[0xFC11, 0x53E0]), Ok((vec![0xFC1, 0x53E], 0)));
        let full = words(16, 15, true, &[3], None);
        assert_eq!(read(full, &[0xFC18]), Ok((vec![-1000], 0)));
    }

    #[test]
    fn flags_are_masked_and_counted() {
        for signed in [false, true] {
            let read = read(words(12, 11, signed, &[], None), &[0x83E8, 0x43E7, 0x03E8]);
            assert_eq!(read, Ok((vec![1000, 999, 1000], 2)));
        }
    }

    #[test]
    fn bits_that_may_belong_to_the_value_are_refused() {
        let doubt = |words, of: &[u16]| read(words, of).expect_err("doubtful").to_string();
        let unsigned = words(12, 11, false, &[], None);
        assert!(doubt(unsigned, &[0xFC18, 0x0123, 0xFD00]).contains("look signed"));
        assert!(doubt(unsigned, &[0x13E8, 0x0123, 0x1400]).contains("more bits"));
        assert!(doubt(words(12, 11, true, &[], None), &[0xF3E8, 0x0123]).contains("more bits"));
        assert!(doubt(words(12, 15, false, &[], None), &[0x0108, 0x0120]).contains("HighBit"));
        assert!(doubt(unsigned, &[0x8108, 0x8120]).contains("offset"));
        assert!(doubt(unsigned, &[0x8000, 0x8000, 0x0120]).contains("special value"));
    }

    #[test]
    fn the_padding_value_may_lie_beyond_the_bits_stored() {
        let signed = words(12, 11, true, &[], Some(0x8000));
        assert_eq!(read(signed, &[0x8000, 0x8000, 0x0123]), Ok((vec![-32768, -32768, 0x123], 0)));
        let unsigned = words(12, 11, false, &[], Some(63536));
        assert_eq!(read(unsigned, &[63536, 0x0123]), Ok((vec![63536, 0x123], 0)));
        let within = words(12, 11, true, &[], Some(0xF830));
        assert_eq!(read(within, &[0xF830]), Ok((vec![-2000], 0)));
    }
}
