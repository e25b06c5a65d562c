//! One frame of one instance: its place, its rescale, where its pixels are.

use dicom_core::Tag;
use dicom_dictionary_std::tags;

use crate::dicom::dataset::{DataSet, View};
use crate::dicom::identity::Identity;
use crate::dicom::uid::{
    FrameOfReferenceUid, SeriesInstanceUid, SopClassUid, SopInstanceUid, StudyInstanceUid,
};
use crate::geometry::{Vec3, cross, dot, norm, scale};

/// What an instance says, as far as the volume needs it.
#[derive(Debug, Clone)]
pub(super) struct Instance {
    pub(super) sop_class_uid: Option<SopClassUid>,
    pub(super) sop_instance_uid: SopInstanceUid,
    pub(super) study_instance_uid: Option<StudyInstanceUid>,
    pub(super) series_instance_uid: Option<SeriesInstanceUid>,
    pub(super) frame_of_reference_uid: Option<FrameOfReferenceUid>,
    pub(super) modality: Option<String>,
    pub(super) image_type: Vec<String>,
    pub(super) has_pixel_data: bool,
    pub(super) is_lossy: bool,
    pub(super) photometric: Option<String>,
    pub(super) samples_per_pixel: Option<u16>,
    /// Whether position or orientation stands in the data set itself.
    pub(super) has_position: bool,
    pub(super) identity: Identity,
    /// Something that nobody reads is not written as it should.
    pub(super) is_odd: bool,
    /// Number of Frames is 0.
    pub(super) frames_are_zero: bool,
    pub(super) matrix: Option<(u16, u16)>,
    /// Bits Stored and Pixel Representation.
    pub(super) format: Option<(u16, u16)>,
    pub(super) number: Option<i64>,
    pub(super) frames: Vec<Frame>,
}

/// One frame. `None` marks what is missing or unusable.
#[derive(Debug, Clone, Default)]
pub(super) struct Frame {
    pub(super) geometry: Option<Geometry>,
    pub(super) rescale: Option<Rescale>,
    /// What Rescale Type says that the values are, if not Hounsfield units.
    pub(super) other_unit: Option<&'static str>,
    pub(super) stack_id: Option<String>,
    pub(super) is_localizer: bool,
}

/// Place of a frame (PS3.3 sections C.7.6.2 and C.7.6.16.2), LPS mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Geometry {
    /// Centre of the first pixel.
    pub(super) position: Vec3,
    /// Unit vector along a row: the way of increasing columns.
    pub(super) along_row: Vec3,
    /// Unit vector down a column: the way of increasing rows.
    pub(super) down_column: Vec3,
    /// mm between rows.
    pub(super) row_spacing: f64,
    /// mm between columns.
    pub(super) column_spacing: f64,
}

impl Geometry {
    /// Unit normal of the frame: along the row × down the column.
    pub(super) fn normal(&self) -> Vec3 {
        cross(self.along_row, self.down_column)
    }
}

/// HU = slope · stored + intercept, and the stored values that are padding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rescale {
    pub(super) slope: f64,
    pub(super) intercept: f64,
}

/// Most that a unit vector may be off its length, and two of them off their right angle: 0.25 mm
/// over 250 mm.
const UNIT_TOLERANCE: f64 = 1e-3;

impl Instance {
    /// Reads the attributes; `None` if there is no SOP Instance UID to call it by.
    pub(super) fn of(data_set: &DataSet<'_>) -> Option<Self> {
        let top = data_set.top();
        let count = top.frames().unwrap_or(1);
        let shared = top.items(tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE).next();
        let per_frame: Vec<_> = top.items(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE).collect();
        let is_described =
            usize::try_from(count) == Ok(per_frame.len()) || (count == 1 && per_frame.is_empty());
        let frames = if is_described {
            (0..per_frame.len().max(1))
                .map(|index| Groups { top, shared, own: per_frame.get(index).copied() }.frame())
                .collect()
        } else {
            // Frames without functional groups have no place; one stands for all of them.
            vec![Frame::default()]
        };
        let lossy_flag = top.text(tags::LOSSY_IMAGE_COMPRESSION).is_some_and(|text| text == "01");
        let frames_are_zero = top.integer(tags::NUMBER_OF_FRAMES) == Some(0);
        Some(Self {
            is_odd: data_set.is_odd,
            frames_are_zero,
            sop_class_uid: top.uid(tags::SOP_CLASS_UID),
            sop_instance_uid: top.uid(tags::SOP_INSTANCE_UID)?,
            study_instance_uid: top.uid(tags::STUDY_INSTANCE_UID),
            series_instance_uid: top.uid(tags::SERIES_INSTANCE_UID),
            frame_of_reference_uid: top.uid(tags::FRAME_OF_REFERENCE_UID),
            modality: top.text(tags::MODALITY),
            image_type: top.texts(tags::IMAGE_TYPE),
            has_pixel_data: data_set.pixels().is_some(),
            is_lossy: data_set.syntax.lossy || lossy_flag,
            photometric: top.text(tags::PHOTOMETRIC_INTERPRETATION),
            samples_per_pixel: top.u16(tags::SAMPLES_PER_PIXEL),
            has_position: [tags::IMAGE_POSITION_PATIENT, tags::IMAGE_ORIENTATION_PATIENT]
                .into_iter()
                .any(|tag| top.bytes(tag).is_some_and(|value| !value.is_empty())),
            identity: top.identity(),
            matrix: top.u16(tags::ROWS).zip(top.u16(tags::COLUMNS)),
            format: top.u16(tags::BITS_STORED).zip(top.u16(tags::PIXEL_REPRESENTATION)),
            number: top.integer(tags::INSTANCE_NUMBER),
            frames,
        })
    }
}

/// Where an attribute of a frame can stand: in the frame's own functional group, in the shared
/// one, or (not multi-frame) in the data set itself.
#[derive(Clone, Copy)]
struct Groups<'a> {
    top: View<'a>,
    shared: Option<View<'a>>,
    own: Option<View<'a>>,
}

impl<'a> Groups<'a> {
    /// The item of the functional group `sequence`, or the data set if there are no groups.
    fn group(self, sequence: Tag) -> Option<View<'a>> {
        if self.shared.is_none() && self.own.is_none() {
            return Some(self.top);
        }
        let of = |groups: Option<View<'a>>| groups.and_then(|groups| groups.items(sequence).next());
        of(self.own).or_else(|| of(self.shared))
    }

    fn frame(self) -> Frame {
        let frame_type = self.group(tags::CT_IMAGE_FRAME_TYPE_SEQUENCE).map(|g| g.texts(tags::FRAME_TYPE));
        Frame {
            geometry: self.geometry(),
            rescale: self.rescale(),
            other_unit: self.other_unit(),
            stack_id: self.group(tags::FRAME_CONTENT_SEQUENCE).and_then(|group| group.text(tags::STACK_ID)),
            is_localizer: frame_type.unwrap_or_default().iter().any(|value| value == "LOCALIZER"),
        }
    }

    fn geometry(self) -> Option<Geometry> {
        let position = self.group(tags::PLANE_POSITION_SEQUENCE)?.decimals(tags::IMAGE_POSITION_PATIENT)?;
        let [rx, ry, rz, cx, cy, cz] =
            self.group(tags::PLANE_ORIENTATION_SEQUENCE)?.decimals(tags::IMAGE_ORIENTATION_PATIENT)?;
        let [row_spacing, column_spacing] =
            self.group(tags::PIXEL_MEASURES_SEQUENCE)?.decimals(tags::PIXEL_SPACING)?;
        let (row, column) = ([rx, ry, rz], [cx, cy, cz]);
        let is_unit = |v: Vec3| (norm(v) - 1.0).abs() < UNIT_TOLERANCE;
        let is_sound = is_unit(row)
            && is_unit(column)
            && dot(row, column).abs() < UNIT_TOLERANCE
            && row_spacing > 0.0
            && column_spacing > 0.0;
        is_sound.then(|| Geometry {
            position,
            along_row: scale(row, 1.0 / norm(row)),
            down_column: scale(column, 1.0 / norm(column)),
            row_spacing,
            column_spacing,
        })
    }

    fn rescale(self) -> Option<Rescale> {
        let group = self.group(tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE)?;
        let [slope] = group.decimals(tags::RESCALE_SLOPE)?;
        let [intercept] = group.decimals(tags::RESCALE_INTERCEPT)?;
        (self.other_unit().is_none() && slope != 0.0).then_some(Rescale { slope, intercept })
    }

    fn other_unit(self) -> Option<&'static str> {
        let group = self.group(tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE)?;
        other_unit(&group.text(tags::RESCALE_TYPE)?)
    }
}

/// What a Rescale Type stands for (defined terms of PS3.3 section C.11.1.1.2); `None` for Hounsfield
/// units, in the spellings that are met: case, spaces and points don't count, and "US" (unspecified) is
/// what some scanners write.
fn other_unit(rescale_type: &str) -> Option<&'static str> {
    let term: String = rescale_type.chars().filter(char::is_ascii_alphanumeric).collect();
    Some(match term.to_ascii_uppercase().as_str() {
        "HU" | "HOUNSFIELD" | "HOUNSFIELDUNIT" | "HOUNSFIELDUNITS" | "US" => return None,
        "HUMOD" => "modified Hounsfield units (HU_MOD)",
        "OD" => "optical density (OD)",
        "MGML" => "mass concentration (MGML)",
        "ZEFF" => "effective atomic number (Z_EFF)",
        "ED" => "electron density (ED)",
        "EDW" => "electron density against water (EDW)",
        "PCT" => "percent (PCT)",
        _ => "a unit that the standard does not define",
    })
}

#[cfg(test)]
mod tests {
    use super::other_unit;

    #[test]
    fn hounsfield_units_are_written_in_several_ways() {
        for text in ["HU", "hu", " Hu ", "H.U.", "Hounsfield", "HOUNSFIELD UNITS", "Hounsfield Unit", "US"] {
            assert_eq!(other_unit(text), None, "{text}");
        }
        for (text, unit) in
            [("HU_MOD", "modified"), ("od", "optical"), ("Z_EFF", "atomic"), ("X", "not define")]
        {
            assert!(other_unit(text).is_some_and(|told| told.contains(unit)), "{text}");
        }
    }
}
