//! How the samples of a compressed stream are read as stored values.
//!
//! A stream has its own precision, and JPEG 2000 its own sign; the data set has BitsStored and
//! PixelRepresentation. Where they differ, a sample is read only if there is one way to read it:
//! as pydicom and GDCM do where they agree.

use std::ops::RangeInclusive;

use super::{Format, PixelError};

/// What a stream says of its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Stream {
    /// Bits of a sample, 1 to 16.
    pub(super) precision: u16,
    /// Whether they have a sign. JPEG and JPEG-LS can't say so: their samples are bits, and their
    /// values may have one all the same.
    pub(super) signed: bool,
    /// JPEG Lossless.
    pub(super) is_jpeg_lossless: bool,
}

/// The samples that have a value: ranges, and what is added to those in it.
pub(super) struct Reading {
    ranges: Vec<(RangeInclusive<i32>, i32)>,
    stream: Stream,
    bits_stored: u16,
    signed: bool,
}

impl Reading {
    /// Of the samples of `stream` in a data set of `format`.
    pub(super) fn new(stream: Stream, format: &Format) -> Self {
        let (bits_stored, signed) = (format.bits_stored, format.signed);
        let ranges = ranges(stream, bits_stored, signed);
        Self { ranges, stream, bits_stored, signed }
    }

    /// The stored values, or an error that tells the first sample without one.
    pub(super) fn values(&self, samples: impl Iterator<Item = i32>) -> Result<Vec<i32>, PixelError> {
        samples.map(|sample| self.value(sample).ok_or_else(|| self.refusal(sample))).collect()
    }

    fn value(&self, sample: i32) -> Option<i32> {
        self.ranges.iter().find(|(range, _)| range.contains(&sample)).map(|(_, offset)| sample + offset)
    }

    fn refusal(&self, sample: i32) -> PixelError {
        let Self { stream, bits_stored, signed, .. } = self;
        let kind = |signed| if signed { "signed" } else { "unsigned" };
        PixelError::Decode(format!(
            "a {} sample of {} bits, {sample}, is no {} value of the {bits_stored} bits stored, or one whose sign is in \
             doubt",
            kind(stream.signed),
            stream.precision,
            kind(*signed)
        ))
    }
}

fn ranges(stream: Stream, bits_stored: u16, signed: bool) -> Vec<(RangeInclusive<i32>, i32)> {
    let (precision, stored) = (i32::from(stream.precision), i32::from(bits_stored));
    let (samples, values) = (1 << precision, 1 << stored);
    if stream.signed == signed {
        // Samples are values; what BitsStored has no room for is none.
        let all = if signed { -values / 2..=values / 2 - 1 } else { 0..=values - 1 };
        return vec![(all, 0)];
    }
    let narrower = samples.min(values);
    let mut ranges = vec![(0..=narrower / 2 - 1, 0)];
    match (signed, precision - stored) {
        // The same bits, of which the stream did not know the highest as the sign, or did wrongly.
        (true, 0) => ranges.push((values / 2..=values - 1, -values)),
        (false, 0) => ranges.push((-values / 2..=-1, values)),
        // Sign extension to the precision of the stream.
        (true, 1..) => {
            ranges.push((samples - values / 2..=samples - 1, -samples));
            if stream.is_jpeg_lossless {
                ranges.push((values / 2..=values - 1, -values));
            }
        }
        // Bits that BitsStored does not count.
        (false, 1..) => ranges.push((values / 2..=values - 1, 0)),
        // Fewer bits than stored: the highest of them may be a sign or not. Of JPEG Lossless it is
        // none, except that with up to 8 bits decoders differ.
        (true, ..0) if stream.is_jpeg_lossless && precision > 8 => {
            ranges.push((samples / 2..=samples - 1, 0));
        }
        (true | false, ..0) => {}
    }
    ranges
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stored bits and sign, then the stream: precision, sign, JPEG Lossless.
    fn read(stored: (u16, bool), stream: (u16, bool, bool), sample: i32) -> Option<i32> {
        let (precision, signed, is_jpeg_lossless) = stream;
        let stream = Stream { precision, signed, is_jpeg_lossless };
        let ranges = ranges(stream, stored.0, stored.1);
        Reading { ranges, stream, bits_stored: stored.0, signed: stored.1 }.value(sample)
    }

    #[test]
    fn samples_are_read_as_pydicom_and_gdcm_do_or_not_at_all() {
        let (signed, unsigned) = (true, false);
        let lossless = |precision| (precision, false, true);
        let jpeg_2000 = |precision, signed| (precision, signed, false);
        for (stored, stream, sample, value) in [
            // The same precision.
            ((12, unsigned), lossless(12), 4095, Some(4095)),
            ((12, signed), lossless(12), 2047, Some(2047)),
            ((12, signed), lossless(12), 2048, Some(-2048)),
            ((12, signed), lossless(12), 4095, Some(-1)),
            ((13, signed), jpeg_2000(13, unsigned), 6192, Some(-2000)),
            ((12, unsigned), jpeg_2000(12, signed), -2048, Some(2048)),
            ((12, signed), jpeg_2000(12, signed), -2048, Some(-2048)),
            ((16, signed), lossless(16), 0x8000, Some(-32768)),
            ((16, unsigned), lossless(16), 0xFFFF, Some(0xFFFF)),
            // A stream of more bits.
            ((12, unsigned), lossless(16), 4095, Some(4095)),
            ((12, unsigned), lossless(16), 4096, None),
            ((12, unsigned), jpeg_2000(16, signed), 4095, Some(4095)),
            ((12, unsigned), jpeg_2000(16, signed), -1, None),
            ((12, signed), lossless(16), 0xF800, Some(-2048)),
            ((12, signed), lossless(16), 0xF7FF, None),
            ((12, signed), lossless(16), 0x0800, Some(-2048)),
            ((12, signed), lossless(16), 0x1000, None),
            ((12, signed), jpeg_2000(16, unsigned), 0x0800, None),
            ((12, signed), jpeg_2000(16, signed), -2049, None),
            ((12, signed), jpeg_2000(16, signed), 2047, Some(2047)),
            // A stream of fewer bits.
            ((16, signed), lossless(12), 4095, Some(4095)),
            ((16, signed), lossless(8), 127, Some(127)),
            ((16, signed), lossless(8), 128, None),
            ((16, unsigned), lossless(12), 4095, Some(4095)),
            ((16, signed), jpeg_2000(12, unsigned), 2047, Some(2047)),
            ((16, signed), jpeg_2000(12, unsigned), 2048, None),
            ((16, signed), jpeg_2000(12, signed), -2048, Some(-2048)),
            ((16, unsigned), jpeg_2000(12, signed), -1, None),
            ((16, unsigned), jpeg_2000(12, signed), 2047, Some(2047)),
        ] {
            assert_eq!(read(stored, stream, sample), value, "{stored:?} {stream:?} {sample}");
        }
    }
}
