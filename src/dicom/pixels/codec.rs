//! JPEG Lossless by our own decoder; JPEG-LS, JPEG 2000 and HTJ2K by those of dicom-rs.

use std::borrow::Cow;
use std::panic::{AssertUnwindSafe, catch_unwind};

use dicom_dictionary_std::uids;
use dicom_encoding::adapters::{PixelDataObject, RawPixelData};
use dicom_encoding::{Codec, TransferSyntaxIndex};
use dicom_transfer_syntax_registry::TransferSyntaxRegistry;

use super::reading::{Reading, Stream};
use super::{Format, PixelError, block_ends, codestream, jpeg_lossless};

/// The compression that is byte for byte what is not compressed.
pub(super) const RLE: &str = uids::RLE_LOSSLESS;

/// Whether pixel data in that transfer syntax comes in fragments.
pub(super) fn is_encapsulated(uid: &str) -> bool {
    uid == RLE
        || TransferSyntaxRegistry
            .get(uid)
            .is_some_and(|syntax| matches!(syntax.codec(), Codec::EncapsulatedPixelData(..)))
}

/// The stored values of one frame, and by how many bytes a block of it ended off its end.
pub(super) fn decode(
    syntax: &'static str,
    frame: &[u8],
    format: &Format,
) -> Result<(Vec<i32>, u32), PixelError> {
    if matches!(syntax, uids::JPEG_LOSSLESS | uids::JPEG_LOSSLESS_SV1) {
        // The stream says which predictor it has: a selection value other than 1 does no harm where
        // the transfer syntax promises 1, and other software reads it too.
        let decoded = jpeg_lossless::decode(frame, format.rows, format.columns)
            .map_err(|fault| PixelError::Decode(format!("the JPEG Lossless frame {fault}")))?;
        let stream = Stream { precision: decoded.precision.into(), signed: false, is_jpeg_lossless: true };
        let values = Reading::new(stream, format).values(decoded.samples.into_iter().map(i32::from))?;
        return Ok((values, 0));
    }
    let head = codestream::read(frame)
        .ok_or_else(|| PixelError::Decode("the compressed frame has no header that can be read".into()))?;
    let agrees = head.width == u32::from(format.columns)
        && head.height == u32::from(format.rows)
        && head.components == 1
        && (1..=16).contains(&head.precision);
    if !agrees {
        return Err(PixelError::Decode(format!(
            "the compressed frame has {} x {} pixels with {} samples of {} bits, the data set says {} x {} with one \
             of {} bits",
            head.width,
            head.height,
            head.components,
            head.precision,
            format.columns,
            format.rows,
            format.bits_stored
        )));
    }
    // The decoders write one byte for a sample of up to 8 bits, two for one of up to 16, whatever
    // BitsAllocated says.
    let bytes_per_sample = if head.precision <= 8 { 1 } else { 2 };
    let promised = if head.is_jpeg_2000 { block_ends::promised(frame) } else { Cow::Borrowed(frame) };
    let object = OneFrame { syntax, frame: &promised, format, bits: bytes_per_sample * 8 };
    let (bytes, off_its_end) = block_ends::heard(|| run(&object));
    let bytes = bytes?;
    if bytes.len() != format.pixels() * usize::from(bytes_per_sample) {
        return Err(PixelError::Decode("the compressed frame decodes to another size than it says".into()));
    }
    let stream = Stream { precision: head.precision, signed: head.signed, is_jpeg_lossless: false };
    let reading = Reading::new(stream, format);
    let pairs = bytes.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]]));
    let values = match (bytes_per_sample, head.signed) {
        (1, true) => reading.values(bytes.iter().map(|byte| byte.cast_signed().into())),
        (1, false) => reading.values(bytes.iter().map(|byte| i32::from(*byte))),
        (_, true) => reading.values(pairs.map(|pair| pair.cast_signed().into())),
        (_, false) => reading.values(pairs.map(i32::from)),
    }?;
    Ok((values, off_its_end))
}

/// Runs the decoder. Some of them panic on corrupt data.
fn run(object: &OneFrame<'_>) -> Result<Vec<u8>, PixelError> {
    let reader = match TransferSyntaxRegistry.get(object.syntax).map(|syntax| syntax.codec()) {
        Some(Codec::EncapsulatedPixelData(Some(reader), _)) => reader,
        _ => return Err(PixelError::Decode(format!("there is no decoder for {}", object.syntax))),
    };
    let decoded = catch_unwind(AssertUnwindSafe(|| {
        let mut bytes = Vec::new();
        reader.decode_frame(object, 0, &mut bytes).map(|()| bytes)
    }));
    match decoded {
        Ok(Ok(bytes)) => Ok(bytes),
        Ok(Err(error)) => Err(PixelError::Decode(format!("the compressed frame can't be decoded: {error}"))),
        Err(_) => Err(PixelError::Decode("the compressed frame is corrupt".into())),
    }
}

/// A single frame as the decoders want to see it.
struct OneFrame<'a> {
    syntax: &'static str,
    frame: &'a [u8],
    format: &'a Format,
    bits: u16,
}

impl PixelDataObject for OneFrame<'_> {
    fn transfer_syntax_uid(&self) -> &str {
        self.syntax
    }
    fn rows(&self) -> Option<u16> {
        Some(self.format.rows)
    }
    fn cols(&self) -> Option<u16> {
        Some(self.format.columns)
    }
    fn samples_per_pixel(&self) -> Option<u16> {
        Some(1)
    }
    fn bits_allocated(&self) -> Option<u16> {
        Some(self.bits)
    }
    fn bits_stored(&self) -> Option<u16> {
        Some(self.bits.min(self.format.bits_stored))
    }
    fn photometric_interpretation(&self) -> Option<&str> {
        Some("MONOCHROME2")
    }
    fn number_of_frames(&self) -> Option<u32> {
        Some(1)
    }
    fn number_of_fragments(&self) -> Option<u32> {
        Some(1)
    }
    fn fragment(&self, fragment: usize) -> Option<Cow<'_, [u8]>> {
        (fragment == 0).then_some(Cow::Borrowed(self.frame))
    }
    fn offset_table(&self) -> Option<Cow<'_, [u32]>> {
        Some(Cow::Borrowed(&[]))
    }
    fn raw_pixel_data(&self) -> Option<RawPixelData> {
        Some(RawPixelData { fragments: vec![self.frame.to_vec()].into(), offset_table: Vec::new().into() })
    }
}
