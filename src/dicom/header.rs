//! What the catalog keeps of an instance, read without its pixels.

use super::identity::Identity;
use super::uid::{
    FrameOfReferenceUid, SeriesInstanceUid, SopClassUid, SopInstanceUid, StudyInstanceUid, TransferSyntaxUid,
};

/// The attributes of one instance that grouping, the catalog and the search by a user need.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InstanceHeader {
    /// SOP Class UID (0008,0016).
    pub sop_class_uid: SopClassUid,
    /// SOP Instance UID (0008,0018).
    pub sop_instance_uid: SopInstanceUid,
    /// Study Instance UID (0020,000D).
    pub study_instance_uid: StudyInstanceUid,
    /// Series Instance UID (0020,000E).
    pub series_instance_uid: SeriesInstanceUid,
    /// Transfer syntax of the stored bytes.
    pub transfer_syntax_uid: TransferSyntaxUid,
    /// Frame of Reference UID (0020,0052).
    pub frame_of_reference_uid: Option<FrameOfReferenceUid>,
    /// Modality (0008,0060), as it stands there.
    pub modality: Option<String>,
    /// Image Type (0008,0008), its values: tells localizers and secondary captures.
    pub image_type: Vec<String>,
    /// Series Description (0008,103E).
    pub series_description: Option<String>,
    /// Patient and order. For search and the check of one patient only: never logged.
    pub identity: Identity,
    /// Number of Frames (0028,0008); 1 where absent.
    pub frames: u32,
    /// Rows (0028,0010), if the instance has pixels.
    pub rows: Option<u16>,
    /// Columns (0028,0011), if the instance has pixels.
    pub columns: Option<u16>,
    /// Whether there is a Pixel Data element (7FE0,0010).
    pub has_pixel_data: bool,
    /// Photometric Interpretation (0028,0004).
    pub photometric: Option<String>,
    /// Samples per Pixel (0028,0002).
    pub samples_per_pixel: Option<u16>,
    /// Whether Image Position or Image Orientation (Patient) stands in the data set itself, outside of
    /// functional groups; `None` of one that an earlier version stored.
    pub has_position: Option<bool>,
}
