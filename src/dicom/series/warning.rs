//! What is worth knowing about a series that was read all the same.

use serde::{Deserialize, Serialize};

use crate::dicom::series::UnfitReason;
use crate::dicom::uid::SopInstanceUid;

/// Something unusual that was handled; stands in the report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Warning {
    /// Which.
    pub code: WarningCode,
    /// What was found, with its figures.
    pub detail: String,
    /// The instances that were left out (`ignored_instances` alone), in the order of their UIDs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub instances: Vec<IgnoredInstance>,
    /// The rows of slices that don't go with their neighbours (`inconsistent_levels` alone), in the order
    /// of the slices.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rows: Vec<DoubtfulRows>,
}

impl Warning {
    /// One that names no instances.
    pub(super) fn new(code: WarningCode, detail: impl Into<String>) -> Self {
        Self { code, detail: detail.into(), instances: Vec::new(), rows: Vec::new() }
    }
}

/// Rows of a slice that don't go with the slices before and after.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct DoubtfulRows {
    /// The instance.
    pub sop_instance_uid: SopInstanceUid,
    /// The frame within it, counted from 1.
    pub frame: usize,
    /// The first of the rows, counted from 1.
    pub first_row: usize,
    /// The last of them.
    pub last_row: usize,
    /// What is doubtful about them.
    pub doubt: RowsDoubt,
    /// What was measured, in the unit that `doubt` tells.
    pub measured: f64,
    /// The most that the other slices of the series allow, in the same unit.
    pub limit: f64,
}

/// What does not go with the slices before and after.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum RowsDoubt {
    /// Air and tissue lie elsewhere: measured in ordinary changes from slice to slice.
    Place,
    /// The same in a run of slices side by side, from the first to the last of which each is named:
    /// measured in ordinary changes from slice to slice.
    Run,
    /// All lies aside from one slice to the next, as of a patient who moved: mm. Told of the second one.
    Shift,
    /// Two slices are more alike with their neighbours if exchanged: gain, 0 to 1.
    Order,
    /// Something begins or ends with a row: columns that change at once.
    Jump,
    /// Values that are nowhere near in the neighbours: pixels.
    Patch,
    /// Air lies at another level: HU.
    Air,
    /// Soft tissue lies at another level: HU.
    Tissue,
    /// Rows of one value: rows.
    Constant,
    /// The same pixels as another slice: pixels.
    Repeated,
    /// A block of the compressed frame ends before or after its data: bytes. Told of the whole frame.
    Stream,
    /// Air or soft tissue lies at another level than in the other slices, from one slice to the next and
    /// on, as of slices with another slope and intercept than their values have: HU. Told of whole slices.
    Step,
}

/// An instance of the series that is no slice of it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, utoipa::ToSchema)]
pub struct IgnoredInstance {
    /// The instance.
    pub sop_instance_uid: SopInstanceUid,
    /// Why it is none: `not_ct`, `no_pixel_data`, `localizer`, `secondary_capture`, `colour` or `no_place`.
    pub reason: UnfitReason,
}

macro_rules! codes {
    ($($(#[$doc:meta])* $variant:ident = $text:literal),+ $(,)?) => {
        /// The stable code of a [`Warning`].
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, utoipa::ToSchema)]
        #[serde(rename_all = "snake_case")]
        pub enum WarningCode { $($(#[$doc])* $variant),+ }

        impl WarningCode {
            /// All of them.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];
            /// The one name.
            #[must_use]
            pub fn name(self) -> &'static str { match self { $(Self::$variant => $text),+ } }
        }
    };
}

codes! {
    /// The slices are sheared against their normal, by the positions (never by the tag).
    GantryTilt = "gantry_tilt",
    /// The steps between slices differ.
    VariableSpacing = "variable_spacing",
    /// Rows and columns have different pixel spacing.
    AnisotropicPixels = "anisotropic_pixels",
    /// Slices lie further apart than 3 mm: the surface is coarse.
    ThickSlices = "thick_slices",
    /// The instances are numbered from head to feet.
    Descending = "descending",
    /// The scan's axes were permuted or flipped to the patient's: not an axial, supine, head-first
    /// acquisition.
    Reoriented = "reoriented",
    /// The scan's axes are not the patient's: off by some degrees.
    Oblique = "oblique",
    /// Pixels marked as padding were set to air.
    Padding = "padding",
    /// The matrix has odd or unequal sides.
    UnusualMatrix = "unusual_matrix",
    /// Instances were there twice with the same content.
    DuplicateInstances = "duplicate_instances",
    /// Values beyond the range of 16-bit Hounsfield units were clipped.
    ClippedHu = "clipped_hu",
    /// Instances of the series are no slices of it (a localizer, a dose report) and were left out.
    IgnoredInstances = "ignored_instances",
    /// The pixels went through a lossy compression.
    LossyCompression = "lossy_compression",
    /// Elements or sequences that nobody reads are not encoded as they should, and were passed over.
    OddEncoding = "odd_encoding",
    /// Number of Frames is 0 in a class without frames; it was read as 1.
    ZeroFrames = "zero_frames",
    /// Zeros follow the pixels, more than the one byte that pads them to an even length.
    TrailingZeros = "trailing_zeros",
    /// Pixels had bits set beside their value, which were masked.
    UnusedBits = "unused_bits",
    /// Slices, or rows of them, don't go with the slices before and after, as those of damaged data do.
    InconsistentLevels = "inconsistent_levels",
}
