//! Collects the attributes of [`InstanceHeader`] on the walk.

use dicom_core::Tag;
use dicom_dictionary_std::tags;

use super::input::Input;
use super::pixels::{PixelExtent, native};
use super::values::{decoded, text, texts};
use super::walk::{Event, Walker};
use super::{Layout, ScanError};
use crate::dicom::dataset::number_of_frames;
use crate::dicom::header::InstanceHeader;
use crate::dicom::identity::Identity;
use crate::dicom::pixel_extent::{Matrix, PixelExtentError};
use crate::dicom::uid::{SeriesInstanceUid, SopInstanceUid, TransferSyntaxUid};

/// The most bytes that an attribute of the header may have. The longest by the standard are
/// Image Type and Specific Character Set, with some values of 16 characters each.
const MAX_VALUE: usize = 4096;

/// The values as they stand in the data set.
#[derive(Default)]
pub(super) struct Found {
    values: Vec<(Tag, Vec<u8>, Layout)>,
    pixels: PixelExtent,
    has_position: bool,
}

const WANTED: [Tag; 21] = [
    tags::SPECIFIC_CHARACTER_SET,
    tags::IMAGE_TYPE,
    tags::SOP_CLASS_UID,
    tags::SOP_INSTANCE_UID,
    tags::ACCESSION_NUMBER,
    tags::MODALITY,
    tags::SERIES_DESCRIPTION,
    tags::PATIENT_NAME,
    tags::PATIENT_ID,
    tags::ISSUER_OF_PATIENT_ID,
    tags::PATIENT_BIRTH_DATE,
    tags::PATIENT_SEX,
    tags::STUDY_INSTANCE_UID,
    tags::SERIES_INSTANCE_UID,
    tags::FRAME_OF_REFERENCE_UID,
    tags::SAMPLES_PER_PIXEL,
    tags::PHOTOMETRIC_INTERPRETATION,
    tags::NUMBER_OF_FRAMES,
    tags::ROWS,
    tags::COLUMNS,
    tags::BITS_ALLOCATED,
];

/// Walks to the end of the data set. What was found stays in `found` if the walk fails.
pub(super) fn collect<I: Input>(walker: &mut Walker<'_, I>, found: &mut Found) -> Result<(), ScanError> {
    // Whether the fragments that follow are those of Pixel Data.
    let mut of_pixels = false;
    while let Some(event) = walker.next()? {
        if !walker.at_top() {
            continue;
        }
        match event {
            Event::Element { tag, value, .. } if tag == tags::PIXEL_DATA => {
                found.pixels = native(walker, value.length, found.matrix())?;
            }
            Event::Fragments(tag) => of_pixels = tag == tags::PIXEL_DATA,
            Event::Fragment(span) if of_pixels => found.pixels.add_fragment(span.length),
            Event::Element { tag, value, .. }
                if [tags::IMAGE_POSITION_PATIENT, tags::IMAGE_ORIENTATION_PATIENT].contains(&tag) =>
            {
                found.has_position |= value.length > 0;
            }
            // Of an element that stands twice the first counts, and the others cost no memory.
            Event::Element { tag, layout, .. } if WANTED.contains(&tag) && found.value(tag).is_none() => {
                let value = walker.value(tag, MAX_VALUE)?;
                found.values.push((tag, value, layout));
            }
            _ => {}
        }
    }
    Ok(())
}

impl Found {
    /// The series and the instance, if both were found.
    pub(super) fn identity(&self) -> Option<(SeriesInstanceUid, SopInstanceUid)> {
        Some((self.uid(tags::SERIES_INSTANCE_UID)?, self.uid(tags::SOP_INSTANCE_UID)?))
    }

    fn value(&self, tag: Tag) -> Option<&[u8]> {
        self.values.iter().find(|(t, ..)| *t == tag).map(|(_, value, _)| value.as_slice())
    }

    /// The matrix of pixels with one sample, as far as it is described.
    fn matrix(&self) -> Option<Matrix> {
        if self.u16(tags::SAMPLES_PER_PIXEL).unwrap_or(1) != 1 {
            return None;
        }
        let frames = self.value(tags::NUMBER_OF_FRAMES).map(text).filter(|text| !text.is_empty());
        Some(Matrix {
            rows: self.u16(tags::ROWS)?,
            columns: self.u16(tags::COLUMNS)?,
            // No frames at all are those of a single-frame instance that says so needlessly.
            frames: frames.map_or(Some(1), |text| text.parse().ok())?.max(1),
            bits_allocated: self.u16(tags::BITS_ALLOCATED)?,
        })
    }

    /// Pixel data of another size than described.
    pub(super) fn pixel_fault(&self) -> Option<PixelExtentError> {
        self.pixels.fault(self.matrix())
    }

    fn u16(&self, tag: Tag) -> Option<u16> {
        let (_, value, layout) = self.values.iter().find(|(t, ..)| *t == tag)?;
        Some(layout.u16(value.get(..2)?.try_into().ok()?))
    }

    fn uid<T: std::str::FromStr>(&self, tag: Tag) -> Option<T> {
        text(self.value(tag)?).parse().ok()
    }

    /// Text in the data set's character set (PS3.3 section C.12.1.1.2), `None` where empty.
    fn text(&self, tag: Tag) -> Option<String> {
        let text = decoded(self.value(tag)?, self.value(tags::SPECIFIC_CHARACTER_SET));
        Some(text).filter(|text| !text.is_empty())
    }

    /// The header; what an instance can't be filed without must be there.
    pub(super) fn finish(self, transfer_syntax_uid: TransferSyntaxUid) -> Result<InstanceHeader, ScanError> {
        let missing = |attribute| ScanError::Missing { attribute };
        let frames = match self.value(tags::NUMBER_OF_FRAMES).map(text).filter(|text| !text.is_empty()) {
            None => 1,
            Some(text) => {
                let class = self.uid(tags::SOP_CLASS_UID);
                let frames = text.parse().ok().and_then(|frames| number_of_frames(frames, class.as_ref()));
                frames.ok_or(missing("NumberOfFrames (0028,0008)"))?
            }
        };
        Ok(InstanceHeader {
            sop_class_uid: self.uid(tags::SOP_CLASS_UID).ok_or(missing("SOPClassUID (0008,0016)"))?,
            sop_instance_uid: self
                .uid(tags::SOP_INSTANCE_UID)
                .ok_or(missing("SOPInstanceUID (0008,0018)"))?,
            study_instance_uid: self
                .uid(tags::STUDY_INSTANCE_UID)
                .ok_or(missing("StudyInstanceUID (0020,000D)"))?,
            series_instance_uid: self
                .uid(tags::SERIES_INSTANCE_UID)
                .ok_or(missing("SeriesInstanceUID (0020,000E)"))?,
            transfer_syntax_uid,
            frame_of_reference_uid: self.uid(tags::FRAME_OF_REFERENCE_UID),
            modality: self.text(tags::MODALITY),
            image_type: self.value(tags::IMAGE_TYPE).map(texts).unwrap_or_default(),
            series_description: self.text(tags::SERIES_DESCRIPTION),
            identity: Identity {
                patient_id: self.text(tags::PATIENT_ID),
                issuer_of_patient_id: self.text(tags::ISSUER_OF_PATIENT_ID),
                patient_name: self.text(tags::PATIENT_NAME),
                patient_birth_date: self.text(tags::PATIENT_BIRTH_DATE),
                patient_sex: self.text(tags::PATIENT_SEX),
                accession_number: self.text(tags::ACCESSION_NUMBER),
            },
            frames,
            rows: self.u16(tags::ROWS),
            columns: self.u16(tags::COLUMNS),
            has_pixel_data: self.pixels.any(),
            photometric: self.value(tags::PHOTOMETRIC_INTERPRETATION).map(text).filter(|t| !t.is_empty()),
            samples_per_pixel: self.u16(tags::SAMPLES_PER_PIXEL),
            has_position: Some(self.has_position),
        })
    }
}
