//! The attributes that both kinds of instance have, and how their values are written.

use dicom_core::smallvec::SmallVec;
use dicom_core::value::DataSetSequence;
use dicom_core::{DataElement, PrimitiveValue, Tag, VR};
use dicom_dictionary_std::{tags, uids as dictionary};
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};
use ndarray::ArrayView2;

use super::super::{Options, uids};
use super::INTERCEPT;
use crate::dicom::uid::SopInstanceUid;

/// A data set under construction.
pub(super) struct Attributes(InMemDicomObject);

impl Default for Attributes {
    fn default() -> Self {
        Self(InMemDicomObject::new_empty())
    }
}

impl Attributes {
    /// Text of one value, or of several separated by `\`.
    pub(super) fn text(mut self, tag: Tag, vr: VR, value: impl Into<String>) -> Self {
        self.0.put_str(tag, vr, value.into());
        self
    }

    /// Decimal strings (PS3.5 6.2: at most 16 characters).
    pub(super) fn decimals(self, tag: Tag, values: &[f64]) -> Self {
        let text: Vec<String> = values.iter().map(|&value| decimal(value)).collect();
        self.text(tag, VR::DS, text.join("\\"))
    }

    /// One unsigned number of 16 bits.
    pub(super) fn short(mut self, tag: Tag, value: usize) -> Self {
        let value = u16::try_from(value).expect("phantoms have at most 4096 rows, columns and slices");
        self.0.put(DataElement::new(tag, VR::US, PrimitiveValue::from(value)));
        self
    }

    /// A number of 32 bits.
    pub(super) fn long(mut self, tag: Tag, values: &[usize]) -> Self {
        let values: SmallVec<[u32; 2]> =
            values.iter().map(|&v| u32::try_from(v).expect("counts are small")).collect();
        self.0.put(DataElement::new(tag, VR::UL, PrimitiveValue::U32(values)));
        self
    }

    /// A sequence.
    pub(super) fn items(mut self, tag: Tag, items: impl IntoIterator<Item = Self>) -> Self {
        let items: Vec<_> = items.into_iter().map(|item| item.0).collect();
        self.0.put(DataElement::new(tag, VR::SQ, DataSetSequence::from(items)));
        self
    }

    /// Pixel Data of stored words.
    pub(super) fn pixels(mut self, words: Vec<u16>) -> Self {
        self.0.put(DataElement::new(tags::PIXEL_DATA, VR::OW, PrimitiveValue::U16(words.into())));
        self
    }

    /// As a Part 10 file.
    pub(super) fn into_file(self, class: &str, instance: &SopInstanceUid) -> Vec<u8> {
        let attributes = self.text(tags::SOP_CLASS_UID, VR::UI, class).text(
            tags::SOP_INSTANCE_UID,
            VR::UI,
            instance.as_str(),
        );
        let meta = FileMetaTableBuilder::new()
            .transfer_syntax(dictionary::EXPLICIT_VR_LITTLE_ENDIAN)
            .media_storage_sop_class_uid(class)
            .media_storage_sop_instance_uid(instance.as_str());
        let object = attributes.0.with_meta(meta).expect("class, instance and transfer syntax are given");
        let mut bytes = Vec::new();
        object.write_all(&mut bytes).expect("a vector takes any number of bytes");
        bytes
    }
}

/// Patient, study, series, frame of reference and equipment (PS3.3 C.7), and the description of the
/// pixels (C.7.6.3).
pub(super) fn common(options: &Options, rows: usize, columns: usize) -> Attributes {
    let identity = uids::identity(options);
    let study = identity.study_instance_uid.map(String::from).unwrap_or_default();
    let frame = identity.frame_of_reference_uid.map(String::from).unwrap_or_default();
    Attributes::default()
        .text(tags::SPECIFIC_CHARACTER_SET, VR::CS, "ISO_IR 100")
        .text(tags::STUDY_DATE, VR::DA, "20250101")
        .text(tags::STUDY_TIME, VR::TM, "120000")
        .text(tags::ACCESSION_NUMBER, VR::SH, "")
        .text(tags::MODALITY, VR::CS, "CT")
        .text(tags::MANUFACTURER, VR::LO, "triplanar phantom")
        .text(tags::REFERRING_PHYSICIAN_NAME, VR::PN, "")
        .text(tags::SERIES_DESCRIPTION, VR::LO, "synthetic head")
        .text(tags::PATIENT_NAME, VR::PN, format!("PHANTOM^{}", options.seed))
        .text(tags::PATIENT_ID, VR::LO, format!("PHANTOM-{}", options.seed))
        .text(tags::PATIENT_BIRTH_DATE, VR::DA, "")
        .text(tags::PATIENT_SEX, VR::CS, "O")
        .text(tags::PATIENT_POSITION, VR::CS, options.acquisition.position.code())
        .text(tags::STUDY_INSTANCE_UID, VR::UI, study)
        .text(tags::SERIES_INSTANCE_UID, VR::UI, identity.series_instance_uid.as_str())
        .text(tags::STUDY_ID, VR::SH, "1")
        .text(tags::SERIES_NUMBER, VR::IS, "1")
        .text(tags::FRAME_OF_REFERENCE_UID, VR::UI, frame)
        .text(tags::POSITION_REFERENCE_INDICATOR, VR::LO, "")
        .short(tags::SAMPLES_PER_PIXEL, 1)
        .text(tags::PHOTOMETRIC_INTERPRETATION, VR::CS, "MONOCHROME2")
        .short(tags::ROWS, rows)
        .short(tags::COLUMNS, columns)
        .short(tags::BITS_ALLOCATED, 16)
        .short(tags::BITS_STORED, 16)
        .short(tags::HIGH_BIT, 15)
        .short(tags::PIXEL_REPRESENTATION, 0)
}

/// Appends the stored values of an image, row by row.
pub(super) fn append_stored(words: &mut Vec<u16>, image: ArrayView2<'_, i16>) {
    words.extend(image.iter().map(|&hu| (hu - INTERCEPT).cast_unsigned()));
}

/// At most 16 characters, ten decimals at most, no trailing zeros.
fn decimal(value: f64) -> String {
    let text = format!("{value:.10}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}
