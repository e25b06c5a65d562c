//! Differences from their codes (sections C.2, H.1.2.2 and H.2.2; table H.2).

use super::Fault;
use super::bits::Bits;

/// Bits that are looked up at once: the code, and mostly the additional bits with it.
const LOOKAHEAD: u32 = 12;
/// The category whose one difference, 32768, has no additional bits.
const LAST: u8 = 16;
/// Marks an entry with the whole difference.
const WHOLE: u8 = 0xFF;

/// A code table as a DHT segment defines it (section B.2.4.2).
#[derive(Clone, Copy)]
pub(super) struct Definition<'a> {
    /// Codes of 1 to 16 bits.
    pub(super) counts: &'a [u8; 16],
    /// The categories in the order of their codes.
    pub(super) categories: &'a [u8],
}

/// What the next bits begin with.
#[derive(Clone, Copy, Default)]
struct Entry {
    /// Bits of the code, or of code and additional bits; 0 for a longer code or none.
    bits: u8,
    /// Number of additional bits, or [`WHOLE`].
    category: u8,
    difference: u16,
}

/// A code table ready for decoding.
pub(super) struct Table {
    ahead: Vec<Entry>,
    /// For each length: the first code, how many there are, where their categories begin.
    long: [(usize, usize, usize); 17],
    categories: Vec<u8>,
}

impl Table {
    /// Assigns the codes (figures C.1 and C.2).
    pub(super) fn new(definition: Definition<'_>) -> Result<Self, Fault> {
        let categories = definition.categories.to_vec();
        if categories.iter().any(|category| *category > LAST) {
            return Err(Fault::BadTable);
        }
        let mut table =
            Self { ahead: vec![Entry::default(); 1 << LOOKAHEAD], long: [(0, 0, 0); 17], categories };
        let (mut code, mut index) = (0_usize, 0);
        for (length, &count) in (1_u32..).zip(definition.counts) {
            let count = usize::from(count);
            // More codes than a prefix code of that length can have.
            if code + count > 1 << length {
                return Err(Fault::BadTable);
            }
            table.long[length as usize] = (code, count, index);
            if length <= LOOKAHEAD {
                for (code, at) in (code..code + count).zip(index..) {
                    table.look_ahead(code, length, at)?;
                }
            }
            code = (code + count) << 1;
            index += count;
        }
        Ok(table)
    }

    /// The entries of all bits that begin with that code.
    fn look_ahead(&mut self, code: usize, length: u32, at: usize) -> Result<(), Fault> {
        let category = *self.categories.get(at).ok_or(Fault::BadTable)?;
        let additional = if category == LAST { 0 } else { u32::from(category) };
        let rest = LOOKAHEAD - length;
        for (low, entry) in self.ahead[code << rest..][..1 << rest].iter_mut().enumerate() {
            *entry = match rest.checked_sub(additional) {
                Some(unused) => Entry {
                    bits: (length + additional) as u8,
                    category: WHOLE,
                    difference: difference(category, low >> unused),
                },
                None => Entry { bits: length as u8, category, difference: 0 },
            };
        }
        Ok(())
    }

    /// The next difference, modulo 65536.
    #[inline]
    pub(super) fn next(&self, bits: &mut Bits<'_>) -> Result<u16, Fault> {
        // The longest code and the most additional bits are 31 together.
        bits.fill();
        let entry = self.ahead[bits.peek(LOOKAHEAD)];
        if entry.category == WHOLE {
            bits.take(entry.bits.into())?;
            return Ok(entry.difference);
        }
        self.long(entry, bits)
    }

    fn long(&self, entry: Entry, bits: &mut Bits<'_>) -> Result<u16, Fault> {
        let category = if entry.bits > 0 {
            bits.take(entry.bits.into())?;
            entry.category
        } else {
            self.long_code(bits)?
        };
        if category == 0 || category == LAST {
            return Ok(difference(category, 0));
        }
        let additional = bits.peek(category.into());
        bits.take(category.into())?;
        Ok(difference(category, additional))
    }

    /// The category of a code longer than [`LOOKAHEAD`].
    fn long_code(&self, bits: &mut Bits<'_>) -> Result<u8, Fault> {
        for length in LOOKAHEAD + 1..=16 {
            let (first, count, index) = self.long[length as usize];
            let code = bits.peek(length);
            if (first..first + count).contains(&code) {
                bits.take(length)?;
                return self.categories.get(index + code - first).copied().ok_or(Fault::NoCode);
            }
        }
        // Zeros beyond the end may be no code either.
        bits.take(16)?;
        Err(Fault::NoCode)
    }
}

/// The difference of a category with its additional bits (table H.2, figure F.12).
fn difference(category: u8, additional: usize) -> u16 {
    let additional = additional as u16;
    match category {
        0 => 0,
        LAST => 0x8000,
        // The lower half are the negative ones.
        _ if additional >> (category - 1) == 0 => additional.wrapping_sub((1 << category) - 1),
        _ => additional,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_those_of_table_h_2() {
        let of = |category, additional| difference(category, additional).cast_signed();
        assert_eq!(of(0, 0), 0);
        assert_eq!((of(1, 0), of(1, 1)), (-1, 1));
        assert_eq!((of(2, 0), of(2, 1), of(2, 2), of(2, 3)), (-3, -2, 2, 3));
        assert_eq!(
            (of(15, 0), of(15, 0x3FFF), of(15, 0x4000), of(15, 0x7FFF)),
            (-32767, -16384, 16384, 32767)
        );
        assert_eq!(difference(16, 0), 32768);
    }
}
