//! Stored values (PS3.3 section C.7.6.3, PS3.5 section 8) of the frames of one instance.
//!
//! Each frame is decoded alone: its fragments are put together here, the decoder is given one
//! frame and told nothing of the rest. Before it runs, the size that the compressed stream claims
//! must be the size that the data set claims, and a decoder that panics is an error like any other.
//! What comes out must have that size too, and no value beyond BitsStored (0028,0101).

mod block_ends;
mod codec;
mod codestream;
mod fragments;
mod jpeg_lossless;
mod reading;
mod rle;
mod words;

use std::borrow::Cow;

use dicom_dictionary_std::tags;

use super::dataset::{DataSet, RawPixels};
use super::pixel_extent::{Matrix, PixelExtentError};
use super::scan::Limits;

pub(crate) use words::Stored;
use words::Words;

/// Why a frame has no values.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PixelError {
    /// There is no Pixel Data element (7FE0,0010), or it is empty.
    #[error("there is no pixel data")]
    NoPixelData,
    /// More than one sample a pixel.
    #[error(
        "photometric interpretation {0} is not one of a CT: MONOCHROME1 or MONOCHROME2 with one sample a pixel"
    )]
    Photometric(String),
    /// An attribute that describes the pixels is missing or makes no sense.
    #[error("{0}")]
    Description(String),
    /// There are fewer or more bytes than the matrix and the frames need.
    #[error(transparent)]
    Extent(#[from] PixelExtentError),
    /// The bytes can't be decoded.
    #[error("{0}")]
    Decode(String),
}

/// The most pixels of one frame: 4096 x 4096. Scanners reach 2048 x 2048; more is a claim to make us
/// allocate.
const MAX_PIXELS: u32 = 1 << 24;

/// How the pixels are stored.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Format {
    pub(crate) rows: u16,
    pub(crate) columns: u16,
    pub(crate) frames: u32,
    pub(crate) photometric: String,
    bits_allocated: u16,
    bits_stored: u16,
    high_bit: u16,
    pub(crate) signed: bool,
}

impl Format {
    /// The description in the data set, checked.
    pub(crate) fn of(data_set: &DataSet<'_>) -> Result<Self, PixelError> {
        let top = data_set.top();
        let required = |tag, name: &str| {
            top.u16(tag).ok_or_else(|| PixelError::Description(format!("{name} is missing")))
        };
        let photometric = top.text(tags::PHOTOMETRIC_INTERPRETATION).unwrap_or_else(|| "(none)".into());
        if top.u16(tags::SAMPLES_PER_PIXEL).unwrap_or(1) != 1 {
            return Err(PixelError::Photometric(photometric));
        }
        let bits_allocated = required(tags::BITS_ALLOCATED, "BitsAllocated (0028,0100)")?;
        let bits_stored = top.u16(tags::BITS_STORED).unwrap_or(bits_allocated);
        let high_bit = top.u16(tags::HIGH_BIT).unwrap_or(bits_stored.wrapping_sub(1));
        let sound = matches!(bits_allocated, 8 | 16)
            && (1..=bits_allocated).contains(&bits_stored)
            && (bits_stored - 1..bits_allocated).contains(&high_bit);
        if !sound {
            return Err(PixelError::Description(format!(
                "{bits_stored} bits stored up to bit {high_bit} of {bits_allocated} allocated ones can't be read; \
                 8 or 16 must be allocated"
            )));
        }
        let frames = top
            .frames()
            .ok_or_else(|| PixelError::Description("NumberOfFrames (0028,0008) is no count".into()))?;
        let rows = required(tags::ROWS, "Rows (0028,0010)")?;
        let columns = required(tags::COLUMNS, "Columns (0028,0011)")?;
        if rows == 0 || columns == 0 || u32::from(rows) * u32::from(columns) > MAX_PIXELS {
            return Err(PixelError::Description(format!(
                "the matrix has {columns} x {rows} pixels, not 1 to {MAX_PIXELS}"
            )));
        }
        let signed = top.u16(tags::PIXEL_REPRESENTATION).unwrap_or(0) == 1;
        Ok(Self { rows, columns, frames, photometric, bits_allocated, bits_stored, high_bit, signed })
    }

    /// Pixels of one frame.
    pub(crate) fn pixels(&self) -> usize {
        usize::from(self.rows) * usize::from(self.columns)
    }

    fn bytes_per_sample(&self) -> usize {
        usize::from(self.bits_allocated / 8)
    }

    fn matrix(&self) -> Matrix {
        Matrix {
            rows: self.rows,
            columns: self.columns,
            frames: self.frames,
            bits_allocated: self.bits_allocated,
        }
    }
}

/// While a frame is decoded, for each of its pixels: 4 of the codec's, 2 of its output, 4 of the values.
pub(crate) const BYTES_A_PIXEL: u64 = 10;

/// The frames of one instance, ready to be decoded one by one, from several threads.
pub(crate) struct Frames<'a> {
    pub(crate) format: Format,
    /// Bytes after the pixels, all zeros, beyond the one that pads to an even length.
    pub(crate) surplus: u64,
    words: Words,
    syntax: &'static str,
    encoded: Encoded<'a>,
}

enum Encoded<'a> {
    Native { bytes: &'a [u8], byte_order: ByteOrder },
    Encapsulated(Vec<Cow<'a, [u8]>>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ByteOrder {
    Little,
    Big,
    /// 8-bit samples in big-endian 16-bit words (PS3.5 section 8.1.1 with VR OW).
    SwappedPairs,
}

impl<'a> Frames<'a> {
    /// Finds the frames; decodes nothing yet.
    pub(crate) fn of(data_set: &'a DataSet<'_>) -> Result<Self, PixelError> {
        let raw = data_set.pixels().ok_or(PixelError::NoPixelData)?;
        let format = Format::of(data_set)?;
        let mut surplus = 0;
        let encoded = match raw {
            RawPixels::Native { bytes, vr, layout } => {
                if codec::is_encapsulated(data_set.syntax.uid) {
                    return Err(PixelError::Decode(
                        "the pixel data is not encapsulated as its transfer syntax says".into(),
                    ));
                }
                surplus = format.matrix().check_native(bytes.len() as u64)?;
                let beyond = bytes.len() - usize::try_from(surplus).unwrap_or(0);
                if bytes.get(beyond..).is_some_and(|rest| rest.iter().any(|byte| *byte != 0)) {
                    return Err(format.matrix().trailing(bytes.len() as u64).into());
                }
                let byte_order = match (layout.big_endian, format.bits_allocated, vr) {
                    (false, ..) => ByteOrder::Little,
                    (true, 8, Some(vr)) if &vr == b"OW" => ByteOrder::SwappedPairs,
                    (true, ..) => ByteOrder::Big,
                };
                Encoded::Native { bytes, byte_order }
            }
            RawPixels::Encapsulated { offset_table, fragments } => {
                let filled = fragments.iter().filter(|(_, bytes)| !bytes.is_empty()).count();
                format.matrix().check_fragments(filled as u64)?;
                let extended = data_set.top().bytes(tags::EXTENDED_OFFSET_TABLE).unwrap_or_default();
                let layout = fragments::Layout { offset_table, extended_offset_table: extended, fragments };
                Encoded::Encapsulated(layout.frames(format.frames)?)
            }
        };
        let padding = data_set.top().u16(tags::PIXEL_PADDING_VALUE);
        let words = Words::new(&format, &data_set.top().overlay_bits(), padding);
        Ok(Self { format, surplus, words, syntax: data_set.syntax.uid, encoded })
    }

    /// The stored values of a frame, row by row, with their sign.
    pub(crate) fn stored(&self, frame: usize) -> Result<Stored, PixelError> {
        let count = self.format.pixels();
        let missing = || PixelError::Decode(format!("frame {} is missing", frame + 1));
        match &self.encoded {
            Encoded::Native { bytes, byte_order } => {
                let length = count * self.format.bytes_per_sample();
                let start = frame.checked_mul(length).ok_or_else(missing)?;
                let frame = bytes.get(start..).and_then(|rest| rest.get(..length)).ok_or_else(missing)?;
                if *byte_order == ByteOrder::SwappedPairs {
                    let value = |i: usize| bytes.get((start + i) ^ 1).copied().ok_or_else(missing);
                    let bytes: Vec<u8> = (0..length).map(value).collect::<Result<_, _>>()?;
                    return self.values(&bytes, ByteOrder::Little);
                }
                self.values(frame, *byte_order)
            }
            Encoded::Encapsulated(frames) => {
                let frame = frames.get(frame).ok_or_else(missing)?;
                if self.syntax == codec::RLE {
                    let bytes = rle::decode(frame, count, self.format.bytes_per_sample())?;
                    let stored = self.values(&bytes, ByteOrder::Little)?;
                    // A compressed frame has no room for anything but its samples (PS3.5 section 8.2).
                    return if stored.masked == 0 {
                        Ok(stored)
                    } else {
                        Err(self.beyond_bits_stored(&stored))
                    };
                }
                let (values, off_its_end) = codec::decode(self.syntax, frame, &self.format)?;
                Ok(Stored { values, masked: 0, off_its_end })
            }
        }
    }

    fn values(&self, bytes: &[u8], order: ByteOrder) -> Result<Stored, PixelError> {
        if self.format.bits_allocated == 8 {
            return self.words.values(bytes.iter().map(|byte| u16::from(*byte)));
        }
        let pairs = bytes.chunks_exact(2).map(|pair| [pair[0], pair[1]]);
        match order {
            ByteOrder::Big => self.words.values(pairs.map(u16::from_be_bytes)),
            ByteOrder::Little | ByteOrder::SwappedPairs => self.words.values(pairs.map(u16::from_le_bytes)),
        }
    }

    fn beyond_bits_stored(&self, stored: &Stored) -> PixelError {
        PixelError::Decode(format!(
            "{} of its values go beyond the {} bits stored",
            stored.masked, self.format.bits_stored
        ))
    }
}

/// The stored values of every frame of a Part 10 file, row by row, with their sign: what the
/// decoding alone gives, without geometry and rescale.
///
/// # Errors
/// Anything that keeps the pixels from being decoded, as text.
pub fn stored_values(bytes: &[u8], limits: &Limits) -> Result<Vec<Vec<i32>>, PixelError> {
    let data_set =
        DataSet::open(bytes, limits).map_err(|error| PixelError::Description(error.to_string()))?;
    let frames = Frames::of(&data_set)?;
    (0..frames.format.frames as usize).map(|frame| Ok(frames.stored(frame)?.values)).collect()
}
