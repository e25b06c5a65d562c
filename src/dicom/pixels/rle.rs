//! RLE Lossless (PS3.5 annex G).

use super::PixelError;

/// Decodes one frame of `pixels` single samples into little-endian bytes.
///
/// A segment holds one byte of every sample, the most significant byte first.
pub(super) fn decode(frame: &[u8], pixels: usize, bytes_per_sample: usize) -> Result<Vec<u8>, PixelError> {
    let broken = |what: &str| PixelError::Decode(format!("the RLE frame {what}"));
    let number = |index: usize| -> Option<usize> {
        let bytes = frame.get(index * 4..index * 4 + 4)?;
        usize::try_from(u32::from_le_bytes(bytes.try_into().ok()?)).ok()
    };
    if number(0) != Some(bytes_per_sample) {
        return Err(broken("has another number of segments than its samples have bytes"));
    }
    let mut decoded = vec![0; pixels * bytes_per_sample];
    for segment in 0..bytes_per_sample {
        let start = number(1 + segment).ok_or_else(|| broken("has no header"))?;
        let end = if segment + 1 < bytes_per_sample { number(2 + segment) } else { Some(frame.len()) };
        let bytes =
            end.and_then(|end| frame.get(start..end)).ok_or_else(|| broken("has a segment outside it"))?;
        let place = decoded.iter_mut().skip(bytes_per_sample - 1 - segment).step_by(bytes_per_sample);
        let rest =
            unpack(bytes, place).ok_or_else(|| broken("ends within its pixels, or goes on beyond them"))?;
        // No-operations and zeros that pad the segment to an even length, or more.
        if rest.iter().any(|byte| !matches!(*byte, 0 | NO_OPERATION)) {
            return Err(broken("holds more than its pixels"));
        }
    }
    Ok(decoded)
}

/// The head that stands for nothing.
const NO_OPERATION: u8 = 128;

/// `PackBits` (PS3.5 section G.3.2) into the places given; returns what follows them, or `None` if
/// the last run ends elsewhere than the places.
fn unpack<'b, 'p>(
    mut bytes: &'b [u8],
    mut places: impl ExactSizeIterator<Item = &'p mut u8>,
) -> Option<&'b [u8]> {
    while places.len() > 0 {
        let (&head, rest) = bytes.split_first()?;
        match head {
            // That many and one more bytes as they are.
            0..NO_OPERATION => {
                let (literal, rest) = rest.split_at_checked(usize::from(head) + 1)?;
                if literal.len() > places.len() {
                    return None;
                }
                literal.iter().zip(&mut places).for_each(|(byte, place)| *place = *byte);
                bytes = rest;
            }
            NO_OPERATION => bytes = rest,
            // One byte, repeated.
            _ => {
                let (&byte, after) = rest.split_first()?;
                let count = 257 - usize::from(head);
                if count > places.len() {
                    return None;
                }
                places.by_ref().take(count).for_each(|place| *place = byte);
                bytes = after;
            }
        }
    }
    Some(bytes)
}
