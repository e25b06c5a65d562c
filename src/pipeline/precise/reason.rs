//! Why a border of the patient is no skin that is accepted: one name for each rule.

use serde::{Deserialize, Serialize};

/// Why a stretch of contour was not accepted.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, utoipa::ToSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum StretchReason {
    /// It is not the patient's border but that of what touches the patient: a couch, a holder, a
    /// mask, a strap.
    Foreign,
    /// Something foreign touches the skin right beside.
    Touching,
    /// A mask, a strap, a pad, a fiducial lies on the skin without a gap: a ledge runs around it.
    Covered,
    /// The image or its field of view ends here.
    FieldOfView,
    /// The rim of a nostril, an ear canal or the mouth: behind it is inside.
    Canal,
    /// The voxels do not tell where exactly the skin is: only one of two slices that lie far apart
    /// shows it, no edge is seen, or a layer that is no clear tissue lies on it (a bandage, a gel,
    /// thick hair).
    Unresolved,
}

impl StretchReason {
    /// All reasons.
    pub const ALL: [Self; 6] =
        [Self::Foreign, Self::Touching, Self::Covered, Self::FieldOfView, Self::Canal, Self::Unresolved];

    /// The one name in report, metrics and documentation.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Foreign => "foreign",
            Self::Touching => "touching",
            Self::Covered => "covered",
            Self::FieldOfView => "field_of_view",
            Self::Canal => "canal",
            Self::Unresolved => "unresolved",
        }
    }
}
