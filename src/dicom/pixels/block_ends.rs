//! Whether each code block of a JPEG 2000 stream ends where its data do: damage that leaves the lengths
//! right changes how many bits the arithmetic decoder takes, and so where it stands at the end.
//!
//! The decoder looks at that only of streams that promise it (predictable termination, ISO/IEC 15444-1
//! table A.19), and tells it as a warning through the crate `log`. Encoders end their blocks to the byte
//! without the promise too: Kakadu 2.2 and 7.3, OpenJPEG, GDCM and JasPer, lossless and at a rate, do. So
//! the promise is made for them before the stream is decoded, and the warnings are heard on the
//! thread that decodes. HTJ2K has another block coder, which tells nothing.

use std::borrow::Cow;
use std::cell::Cell;
use std::sync::Once;

use log::{LevelFilter, Log, Metadata, Record};

/// The code block style of predictable termination.
const PREDICTABLE_TERMINATION: u8 = 0x10;
/// Where the style stands in a COD marker segment, from its marker on.
const STYLE_AT: usize = 12;

/// The stream with predictable termination promised in its main header; as it is, if it has no coding style there.
pub(super) fn promised(stream: &[u8]) -> Cow<'_, [u8]> {
    let Some(style) = style(stream) else { return Cow::Borrowed(stream) };
    let mut promised = stream.to_vec();
    if let Some(style) = promised.get_mut(style) {
        *style |= PREDICTABLE_TERMINATION;
    }
    Cow::Owned(promised)
}

/// Where the main header says the style of the code blocks.
fn style(stream: &[u8]) -> Option<usize> {
    // Marker segments after SOC, up to the first tile-part.
    let mut at = 2;
    loop {
        let &[0xFF, marker, high, low] = stream.get(at..at + 4)? else { return None };
        match marker {
            0x52 => return Some(at + STYLE_AT),
            0x90 => return None,
            _ => at += 2 + usize::from(u16::from_be_bytes([high, low])),
        }
    }
}

thread_local! {
    /// How far off the end of a code block the decoder stood at most, bytes, while this thread listens.
    static FARTHEST: Cell<Option<u32>> = const { Cell::new(None) };
}

/// Runs a decoder that doesn't panic; gives by how many bytes the worst of its code blocks ended off its end.
pub(super) fn heard<T>(decode: impl FnOnce() -> T) -> (T, u32) {
    static LISTEN: Once = Once::new();
    LISTEN.call_once(|| {
        // Whoever has another logger in this process hears the warnings instead.
        if log::set_logger(&Ear).is_ok() {
            log::set_max_level(LevelFilter::Warn);
        }
    });
    FARTHEST.set(Some(0));
    let decoded = decode();
    (decoded, FARTHEST.take().unwrap_or(0))
}

struct Ear;

impl Log for Ear {
    fn enabled(&self, _: &Metadata<'_>) -> bool {
        FARTHEST.get().is_some()
    }

    fn log(&self, record: &Record<'_>) {
        if let (Some(farthest), Some(bytes)) = (FARTHEST.get(), bytes_off(&record.args().to_string())) {
            FARTHEST.set(Some(farthest.max(bytes)));
        }
    }

    fn flush(&self) {}
}

/// The bytes left over, or read beyond the end, that a warning tells.
fn bytes_off(warning: &str) -> Option<u32> {
    let (_, told) = warning.split_once("PTERM check failure: ")?;
    told.split(' ').next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use dicom_dictionary_std::uids;

    use super::super::{Format, codec};
    use super::*;

    /// A disc of tissue in noise, 64 x 64 samples of 12 bits, by OpenJPEG 2.5, lossless.
    const FRAME: &[u8] = include_bytes!("testdata/head_64.j2k");

    fn off_its_end(frame: &[u8]) -> Option<u32> {
        let format = Format {
            rows: 64,
            columns: 64,
            frames: 1,
            photometric: "MONOCHROME2".into(),
            bits_allocated: 16,
            bits_stored: 12,
            high_bit: 11,
            signed: false,
        };
        codec::decode(uids::JPEG2000_LOSSLESS, frame, &format).ok().map(|(_, off)| off)
    }

    #[test]
    fn blocks_of_a_whole_frame_end_where_their_data_do() {
        assert_eq!(off_its_end(FRAME), Some(0));
    }

    #[test]
    fn a_flipped_byte_is_seen_at_the_end_of_its_block_or_is_an_error() {
        let header = FRAME.windows(2).position(|two| two == [0xFF, 0x93]).expect("start of data") + 2;
        let places: Vec<usize> = (header..FRAME.len() - 8).step_by(97).collect();
        let harmed = |&at: &usize| {
            let mut frame = FRAME.to_vec();
            frame[at] ^= 0x55;
            off_its_end(&frame)
        };
        let unseen = places.iter().map(harmed).filter(|off| off.is_some_and(|bytes| bytes <= 8)).count();
        // Near the end of a block little follows that could be read wrongly: 7 of 39 here, where blocks are small.
        assert!(unseen * 4 <= places.len(), "{unseen} of {} are not seen", places.len());
    }

    #[test]
    fn nothing_is_promised_where_there_is_no_coding_style() {
        for stream in [&FRAME[..20], b"", &[0xFF, 0x4F, 0xFF, 0x90, 0, 10]] {
            assert!(matches!(promised(stream), Cow::Borrowed(_)));
        }
        let promised = promised(FRAME);
        assert_eq!(promised.iter().zip(FRAME).filter(|(a, b)| a != b).count(), 1);
    }
}
