//! Whether two instances show the same, whatever their transfer syntax.

use dicom_core::Tag;
use dicom_dictionary_std::tags;
use sha2::{Digest, Sha256};

use super::dataset::{DataSet, RawPixels, View};
use super::pixels::{BYTES_A_PIXEL, Frames, PixelError};
use super::scan::{Event, Limits, ScanError};
use crate::memory::Memory;

/// What of the data set itself the digest covers beside the pixels: where the image is and what
/// its values mean.
const ATTRIBUTES: [Tag; 9] = [
    tags::FRAME_OF_REFERENCE_UID,
    tags::IMAGE_POSITION_PATIENT,
    tags::IMAGE_ORIENTATION_PATIENT,
    tags::PIXEL_SPACING,
    tags::RESCALE_SLOPE,
    tags::RESCALE_INTERCEPT,
    tags::RESCALE_TYPE,
    tags::PHOTOMETRIC_INTERPRETATION,
    tags::NUMBER_OF_FRAMES,
];

/// The functional groups of a multi-frame instance that say the same for each frame, and which of the
/// frames are slices of one stack.
const GROUPS: [(Tag, &[Tag]); 6] = [
    (tags::FRAME_CONTENT_SEQUENCE, &[tags::STACK_ID]),
    (tags::CT_IMAGE_FRAME_TYPE_SEQUENCE, &[tags::FRAME_TYPE]),
    (tags::PLANE_POSITION_SEQUENCE, &[tags::IMAGE_POSITION_PATIENT]),
    (tags::PLANE_ORIENTATION_SEQUENCE, &[tags::IMAGE_ORIENTATION_PATIENT]),
    (tags::PIXEL_MEASURES_SEQUENCE, &[tags::PIXEL_SPACING]),
    (
        tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE,
        &[tags::RESCALE_SLOPE, tags::RESCALE_INTERCEPT, tags::RESCALE_TYPE],
    ),
];

/// SHA-256 over what an instance shows: its decoded pixels, their rescale to Hounsfield units,
/// their padding value and the place of each frame. Two instances with the same UID and the same
/// digest are the same image, though one may have been compressed (without loss) on its way.
///
/// `bytes` is a Part 10 file. An instance without pixels has the digest of its attributes; one whose
/// pixels are none of a slice (in colour, of 32 bits) has that of their bytes and what says how to read
/// them, so that it is equal to itself in the same transfer syntax.
///
/// # Errors
/// [`ScanError`] if the structure is not acceptable.
pub fn content_digest(bytes: &[u8], limits: &Limits) -> Result<[u8; 32], ScanError> {
    Ok(content(bytes, limits, &Memory::unlimited())?.digest)
}

/// What an instance shows.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Content {
    /// See [`content_digest`].
    pub(crate) digest: [u8; 32],
    /// Whether its pixels could be decoded, or it has none: another transfer syntax makes no difference.
    pub(crate) is_decoded: bool,
}

/// The same, and whether it is comparable with that of another transfer syntax. What is inflated and
/// decoded on the way is taken from `memory`.
pub(crate) fn content(bytes: &[u8], limits: &Limits, memory: &Memory) -> Result<Content, ScanError> {
    let mut memory = memory.share();
    let data_set = DataSet::open_within(bytes, limits, &mut memory, &|| false)?;
    let top = data_set.top();
    let mut digest = Sha256::new();
    texts(&mut digest, top, &ATTRIBUTES);
    for groups in [tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE, tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE] {
        for frame in top.items(groups) {
            digest.update(b"frame");
            for (group, attributes) in GROUPS {
                for item in frame.items(group) {
                    digest.update(b"group");
                    texts(&mut digest, item, attributes);
                }
            }
        }
    }
    for tag in [tags::ROWS, tags::COLUMNS, tags::PIXEL_PADDING_VALUE, tags::PIXEL_PADDING_RANGE_LIMIT] {
        digest.update(top.u16(tag).map_or(-1, i32::from).to_le_bytes());
    }
    let before = digest.clone();
    match Frames::of(&data_set) {
        Ok(frames) => {
            memory.grow(frames.format.pixels() as u64 * BYTES_A_PIXEL)?;
            match decoded(&mut digest, &frames) {
                Ok(()) => Ok(Content { digest: digest.finalize().into(), is_decoded: true }),
                Err(_) => Ok(Content { digest: encoded(before, &data_set), is_decoded: false }),
            }
        }
        Err(PixelError::NoPixelData) => Ok(Content { digest: digest.finalize().into(), is_decoded: true }),
        Err(_) => Ok(Content { digest: encoded(before, &data_set), is_decoded: false }),
    }
}

/// SHA-256 over all attributes of an instance but its pixels, in any transfer syntax: their values without
/// padding, those of big-endian data sets in little-endian order. What is inflated and copied on the way is
/// taken from `memory`.
///
/// # Errors
/// [`ScanError`] if the structure is not acceptable, or there is no memory.
pub(crate) fn attributes_digest(
    bytes: &[u8],
    limits: &Limits,
    memory: &Memory,
) -> Result<[u8; 32], ScanError> {
    let mut memory = memory.share();
    let data_set = DataSet::open_within(bytes, limits, &mut memory, &|| false)?;
    // The longest value, at most.
    memory.grow(data_set.size())?;
    let mut digest = Sha256::new();
    data_set.walk(limits, &mut |event, value| match event {
        // Group lengths, and padding of the data set, go with the encoding.
        Event::Element { tag, .. } if tag.0 == 0x7FE0 || tag.1 == 0 || tag.0 == 0xFFFC => {}
        Event::Element { tag, vr, layout, .. } => {
            let unit = if layout.big_endian { vr.map_or(1, |vr| unit(&vr)) } else { 1 };
            let mut value = value.to_vec();
            value.chunks_exact_mut(unit).for_each(<[u8]>::reverse);
            let padding = value.iter().rev().take_while(|byte| [0, b' '].contains(byte)).count();
            value.truncate(value.len() - padding);
            digest.update(b"element");
            digest.update(tag.0.to_le_bytes());
            digest.update(tag.1.to_le_bytes());
            digest.update((value.len() as u64).to_le_bytes());
            digest.update(value);
        }
        Event::Sequence(tag) => {
            digest.update(b"sequence");
            digest.update(tag.0.to_le_bytes());
            digest.update(tag.1.to_le_bytes());
        }
        Event::Item => digest.update(b"item"),
        Event::EndOfItem => digest.update(b"end"),
        Event::EndOfSequence => digest.update(b"over"),
        Event::Fragments(_) | Event::Fragment(_) | Event::EndOfFragments => {}
    })?;
    Ok(digest.finalize().into())
}

/// Bytes that are swapped together in big-endian values (PS3.5 section 7.3).
fn unit(vr: &[u8; 2]) -> usize {
    match vr {
        b"US" | b"SS" | b"OW" | b"AT" => 2,
        b"UL" | b"SL" | b"FL" | b"OL" | b"OF" => 4,
        b"FD" | b"OD" | b"OV" | b"SV" | b"UV" => 8,
        _ => 1,
    }
}

fn decoded(digest: &mut Sha256, frames: &Frames<'_>) -> Result<(), PixelError> {
    for frame in 0..frames.format.frames as usize {
        for value in frames.stored(frame)?.values {
            digest.update(value.to_le_bytes());
        }
    }
    Ok(())
}

/// The bytes of the pixels as they stand there.
fn encoded(mut digest: Sha256, data_set: &DataSet<'_>) -> [u8; 32] {
    digest.update(b"encoded");
    digest.update(data_set.syntax.uid);
    for tag in DESCRIPTION {
        digest.update(data_set.top().u16(tag).map_or(-1, i32::from).to_le_bytes());
    }
    for tag in PALETTE {
        let value = data_set.top().bytes(tag);
        digest.update(value.map_or(-1, |value| value.len() as i64).to_le_bytes());
        digest.update(value.unwrap_or_default());
    }
    match data_set.pixels() {
        Some(RawPixels::Native { bytes, .. }) => digest.update(bytes),
        Some(RawPixels::Encapsulated { fragments, .. }) => {
            for (_, fragment) in fragments {
                digest.update((fragment.len() as u64).to_le_bytes());
                digest.update(fragment);
            }
        }
        None => {}
    }
    digest.finalize().into()
}

/// How samples are stored (PS3.3 section C.7.6.3).
const DESCRIPTION: [Tag; 6] = [
    tags::SAMPLES_PER_PIXEL,
    tags::PLANAR_CONFIGURATION,
    tags::BITS_ALLOCATED,
    tags::BITS_STORED,
    tags::HIGH_BIT,
    tags::PIXEL_REPRESENTATION,
];

/// The colours of samples that stand for them (PS3.3 section C.7.9).
pub(super) const PALETTE: [Tag; 11] = [
    tags::RED_PALETTE_COLOR_LOOKUP_TABLE_DESCRIPTOR,
    tags::GREEN_PALETTE_COLOR_LOOKUP_TABLE_DESCRIPTOR,
    tags::BLUE_PALETTE_COLOR_LOOKUP_TABLE_DESCRIPTOR,
    tags::ALPHA_PALETTE_COLOR_LOOKUP_TABLE_DESCRIPTOR,
    tags::PALETTE_COLOR_LOOKUP_TABLE_UID,
    tags::RED_PALETTE_COLOR_LOOKUP_TABLE_DATA,
    tags::GREEN_PALETTE_COLOR_LOOKUP_TABLE_DATA,
    tags::BLUE_PALETTE_COLOR_LOOKUP_TABLE_DATA,
    tags::SEGMENTED_RED_PALETTE_COLOR_LOOKUP_TABLE_DATA,
    tags::SEGMENTED_GREEN_PALETTE_COLOR_LOOKUP_TABLE_DATA,
    tags::SEGMENTED_BLUE_PALETTE_COLOR_LOOKUP_TABLE_DATA,
];

/// Text values without their padding, which differs from one writer to the next.
fn texts(digest: &mut Sha256, item: View<'_>, attributes: &[Tag]) {
    for &tag in attributes {
        let text = item.texts(tag).join("\\");
        digest.update(tag.0.to_le_bytes());
        digest.update(tag.1.to_le_bytes());
        digest.update((text.len() as u64).to_le_bytes());
        digest.update(text);
    }
}
