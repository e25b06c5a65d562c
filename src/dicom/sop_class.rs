//! The SOP classes that are stored here.

use super::uid::SopClassUid;

/// A SOP class (PS3.4 annex B.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SopClass {
    /// Its UID.
    pub uid: &'static str,
    /// Its name in PS3.6 annex A.
    pub name: &'static str,
}

/// Computed tomography: all that is stored here.
pub const ACCEPTED: &[SopClass] = &[
    SopClass { uid: "1.2.840.10008.5.1.4.1.1.2", name: "CT Image Storage" },
    SopClass { uid: "1.2.840.10008.5.1.4.1.1.2.1", name: "Enhanced CT Image Storage" },
    SopClass { uid: "1.2.840.10008.5.1.4.1.1.2.2", name: "Legacy Converted Enhanced CT Image Storage" },
];

/// Whether that SOP class is stored here.
#[must_use]
pub fn is_accepted(uid: &SopClassUid) -> bool {
    ACCEPTED.iter().any(|class| class.uid == uid.as_str())
}

/// Whether an instance of that SOP class is one image and has no functional groups: CT Image Storage.
#[must_use]
pub fn is_single_frame(uid: &SopClassUid) -> bool {
    uid.as_str() == dicom_dictionary_std::uids::CT_IMAGE_STORAGE
}
