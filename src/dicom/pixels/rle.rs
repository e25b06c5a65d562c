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
        unpack(bytes, place).ok_or_else(|| broken("ends before its pixels do"))?;
    }
    Ok(decoded)
}

/// `PackBits` (PS3.5 section G.3.2) into the places given; `None` if it does not fill them.
fn unpack<'p>(mut bytes: &[u8], mut places: impl ExactSizeIterator<Item = &'p mut u8>) -> Option<()> {
    while places.len() > 0 {
        let (&head, rest) = bytes.split_first()?;
        match head {
            // That many and one more bytes as they are.
            0..=127 => {
                let count = usize::from(head) + 1;
                let (literal, rest) = rest.split_at_checked(count)?;
                literal.iter().zip(&mut places).for_each(|(byte, place)| *place = *byte);
                bytes = rest;
            }
            128 => bytes = rest,
            // One byte, repeated.
            129..=255 => {
                let (&byte, rest) = rest.split_first()?;
                places.by_ref().take(257 - usize::from(head)).for_each(|place| *place = byte);
                bytes = rest;
            }
        }
    }
    Some(())
}
