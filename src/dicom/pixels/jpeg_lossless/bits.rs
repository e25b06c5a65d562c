//! The bits of entropy-coded data, most significant first (sections B.1.1.5 and F.2.2.5).

use super::Fault;

/// Reads bits up to the next marker. A byte 0 that stands after a byte FF is no data.
pub(super) struct Bits<'a> {
    stream: &'a [u8],
    /// The next byte that is not in the buffer.
    at: usize,
    /// Bits read ahead, the next one highest; those below `count` are 0.
    buffer: u64,
    count: u32,
}

impl<'a> Bits<'a> {
    /// The data that begin at byte `at` of the stream.
    pub(super) fn new(stream: &'a [u8], at: usize) -> Self {
        Self { stream, at, buffer: 0, count: 0 }
    }

    /// Reads ahead: 32 bits at least, or all that are left.
    #[inline]
    pub(super) fn fill(&mut self) {
        if self.count < 32 {
            self.refill();
        }
    }

    fn refill(&mut self) {
        if let Some(word) = self.stream.get(self.at..).and_then(|rest| rest.first_chunk::<8>()) {
            let word = u64::from_be_bytes(*word);
            if !has_ff(word) {
                // 4 to 8 whole bytes, since fewer than 32 bits are there.
                let bits = (64 - self.count) / 8 * 8;
                self.buffer |= word >> (64 - bits) << (64 - self.count - bits);
                self.count += bits;
                self.at += bits as usize / 8;
                return;
            }
        }
        while self.count <= 56 {
            let (byte, length) = match self.stream.get(self.at..) {
                Some([0xFF, 0x00, ..]) => (0xFF, 2),
                Some([byte, ..]) if *byte != 0xFF => (*byte, 1),
                _ => return,
            };
            self.buffer |= u64::from(byte) << (56 - self.count);
            self.count += 8;
            self.at += length;
        }
    }

    /// The next `count` bits, 1 to 16, of what was read ahead; 0 beyond the end.
    #[inline]
    pub(super) fn peek(&self, count: u32) -> usize {
        (self.buffer >> (64 - count)) as usize
    }

    /// Passes over `count` bits, at most 16.
    #[inline]
    pub(super) fn take(&mut self, count: u32) -> Result<(), Fault> {
        self.count = self.count.checked_sub(count).ok_or(Fault::EndsEarly)?;
        self.buffer <<= count;
        Ok(())
    }

    /// The byte after the data, where a marker stands or the stream ends. Fewer than 8 bits may be
    /// left: those that fill up the last byte.
    pub(super) fn end(self) -> Result<usize, Fault> {
        let is_over = match self.stream.get(self.at..) {
            Some([0xFF, next, ..]) => *next != 0x00,
            Some([0xFF] | []) | None => true,
            Some(_) => false,
        };
        if is_over && self.count < 8 { Ok(self.at) } else { Err(Fault::TooMuch) }
    }
}

/// Whether one of the 8 bytes is FF.
fn has_ff(word: u64) -> bool {
    const LOW: u64 = 0x0101_0101_0101_0101;
    // A byte of the complement is 0: the subtraction borrows into its highest bit.
    let complement = !word;
    complement.wrapping_sub(LOW) & word & (LOW << 7) != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_with_a_byte_ff_is_told() {
        for at in 0..8 {
            assert!(has_ff(0xFF << (at * 8)));
            assert!(has_ff(0x0102_0304_0506_0708 | 0xFF << (at * 8)));
            assert!(!has_ff(0xFE << (at * 8)));
        }
        assert!(!has_ff(0xFEFE_FEFE_7F80_00FE));
    }
}
