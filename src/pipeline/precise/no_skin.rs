//! Why a scan shows no skin of a head.

/// Why there is no skin.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NoSkin {
    /// The volume has fewer than two voxels along an axis, or slices at one place.
    #[error("the volume is too small to hold a surface: a head needs a stack of slices, not a scout")]
    NoVolume,
    /// The histogram shows no air or no soft tissue.
    #[error("the scan shows no air or no soft tissue: are the values Hounsfield units?")]
    NoLevels,
    /// Nothing in the scan can be a patient: it is thin, or alike in all slices, as a couch is.
    #[error(
        "no patient in the scan: nothing in it is thicker than 10 mm and not alike in all slices, as a couch is"
    )]
    NoPatient,
    /// Not enough soft tissue lies within bone to be a brain.
    #[error(
        "no head in the scan: {brain_cm3:.0} cm³ of soft tissue lie within bone, a head has at least {limit_cm3:.0}"
    )]
    NoHead {
        /// Soft tissue within bone, cm³.
        brain_cm3: f64,
        /// The least that is taken for a head, cm³.
        limit_cm3: f64,
    },
    /// The patient's border to the air outside was nowhere accepted.
    #[error("no border of the patient to the air outside could be accepted")]
    NoBorder,
    /// The observer asked to stop.
    #[error("cancelled")]
    Cancelled,
}

impl NoSkin {
    /// The stable code of a reconstruction that failed for it.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::NoVolume => "no_volume",
            Self::NoLevels => "no_tissue",
            Self::NoPatient => "no_patient",
            Self::NoHead { .. } => "no_head",
            Self::NoBorder => "empty_cloud",
            Self::Cancelled => "cancelled",
        }
    }
}
