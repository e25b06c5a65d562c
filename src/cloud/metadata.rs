//! What a cloud's file says about itself.

use super::MaxError;
use crate::dicom::uid::{FrameOfReferenceUid, SeriesInstanceUid};
use crate::geometry::{Frame, Plane};

/// The provenance of a cloud. Holds nothing that names a patient, and no time of day: the same
/// cloud is the same bytes whenever it is made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Metadata {
    /// Series Instance UID (0020,000E) of the source.
    pub series_instance_uid: SeriesInstanceUid,
    /// Frame of Reference UID (0020,0052): the frame in which the coordinates are valid.
    pub frame_of_reference_uid: Option<FrameOfReferenceUid>,
    /// The plane whose cloud this is; `None` for the merged one.
    pub plane: Option<Plane>,
    /// The filter by which points were dropped after the reconstruction, if one was asked for.
    pub max_error_mm: Option<MaxError>,
    /// Name and version of the software that made it, e.g. [`crate::SOFTWARE`].
    pub software: String,
    /// The parameters of the reconstruction as JSON on one line.
    pub parameters_json: String,
}

pub(super) mod key {
    pub(crate) const FRAME: &str = "frame";
    pub(crate) const UNIT: &str = "unit";
    pub(crate) const PLANE: &str = "plane";
    pub(crate) const SERIES: &str = "series_instance_uid";
    pub(crate) const FRAME_OF_REFERENCE: &str = "frame_of_reference_uid";
    pub(crate) const MAX_ERROR: &str = "max_error_mm";
    pub(crate) const SOFTWARE: &str = "software";
    pub(crate) const PARAMETERS: &str = "parameters";
}

/// Characters of a value on one line. Readers have buffers: CloudCompare's PLY reader dies of a line
/// of more than 1024 bytes.
const MAX_VALUE: usize = 200;

/// The value of [`key::PLANE`] for the merged cloud.
pub(super) const TRIPLANAR: &str = "triplanar";

impl Metadata {
    /// The lines `key value` that stand as comments in formats that have comments, in their order. A
    /// long value goes on in the next line, under the same key.
    pub(super) fn lines(&self, frame: Frame) -> Vec<(&'static str, String)> {
        let mut lines = vec![
            (key::FRAME, frame.name().to_owned()),
            (key::UNIT, "mm".to_owned()),
            (key::PLANE, self.plane.map_or(TRIPLANAR, Plane::name).to_owned()),
            (key::SERIES, self.series_instance_uid.to_string()),
        ];
        if let Some(uid) = &self.frame_of_reference_uid {
            lines.push((key::FRAME_OF_REFERENCE, uid.to_string()));
        }
        if let Some(max_error) = self.max_error_mm {
            lines.push((key::MAX_ERROR, max_error.to_string()));
        }
        lines.extend(on_lines(&self.software).map(|part| (key::SOFTWARE, part)));
        lines.extend(on_lines(&self.parameters_json).map(|part| (key::PARAMETERS, part)));
        lines
    }
}

/// The text in parts of at most [`MAX_VALUE`] characters. Line breaks and other control characters
/// would end a comment: they become blanks.
fn on_lines(text: &str) -> impl Iterator<Item = String> {
    let characters: Vec<char> = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    let parts: Vec<_> = characters.chunks(MAX_VALUE).map(|part| part.iter().collect()).collect();
    parts.into_iter()
}
