//! Whether two instances show the same, whatever their transfer syntax.

use dicom_core::Tag;
use dicom_dictionary_std::tags;
use sha2::{Digest, Sha256};

use super::dataset::{DataSet, RawPixels, View};
use super::pixels::{Frames, PixelError};
use super::scan::{Limits, ScanError};

/// Why an instance has no [`content_digest`].
#[derive(Debug, thiserror::Error)]
pub enum DigestError {
    /// Its structure is not acceptable.
    #[error(transparent)]
    Scan(#[from] ScanError),
    /// Its pixels can't be decoded.
    #[error(transparent)]
    Pixels(#[from] PixelError),
}

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

/// The functional groups of a multi-frame instance that say the same for each frame.
const GROUPS: [(Tag, &[Tag]); 4] = [
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
/// [`DigestError`] if the structure is not acceptable.
pub fn content_digest(bytes: &[u8], limits: &Limits) -> Result<[u8; 32], DigestError> {
    let data_set = DataSet::open(bytes, limits)?;
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
    match decoded(&mut digest, &data_set) {
        Ok(()) | Err(PixelError::NoPixelData) => Ok(digest.finalize().into()),
        Err(_) => Ok(encoded(before, &data_set)),
    }
}

fn decoded(digest: &mut Sha256, data_set: &DataSet<'_>) -> Result<(), PixelError> {
    let frames = Frames::of(data_set)?;
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
    for tag in [tags::SAMPLES_PER_PIXEL, tags::BITS_ALLOCATED, tags::BITS_STORED, tags::PIXEL_REPRESENTATION]
    {
        digest.update(data_set.top().u16(tag).map_or(-1, i32::from).to_le_bytes());
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
