//! The three planes of the triplanar approach.

use serde::{Deserialize, Serialize};

/// A plane in which the volume is cut into slices (paper, section 2.3).
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, utoipa::ToSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum Plane {
    /// One slice per z, most superior first.
    Axial,
    /// One slice per x, the patient's right first.
    Sagittal,
    /// One slice per y, posterior first.
    Coronal,
}

impl Plane {
    /// The planes in the order in which their clouds are merged.
    pub const ALL: [Self; 3] = [Self::Axial, Self::Sagittal, Self::Coronal];

    /// `"axial"`, `"sagittal"` or `"coronal"`: the one name in report, API and metrics.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Axial => "axial",
            Self::Sagittal => "sagittal",
            Self::Coronal => "coronal",
        }
    }

    /// 0, 1, 2 in the order of [`Plane::ALL`].
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }
}

/// The planes whose points a vertex stands for: bit 1 axial, 2 sagittal, 4 coronal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub struct PlaneSet(u8);

impl PlaneSet {
    /// No plane.
    pub const EMPTY: Self = Self(0);

    /// The set as the byte that stands in PLY and PCD (`planes`).
    #[must_use]
    pub fn bits(self) -> u8 {
        self.0
    }

    /// The set of that byte; bits above 4 are dropped.
    #[must_use]
    pub fn from_bits(bits: u8) -> Self {
        Self(bits & 7)
    }

    /// Both sets together.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether `plane` is in the set.
    #[must_use]
    pub fn contains(self, plane: Plane) -> bool {
        self.0 & Self::from(plane).0 != 0
    }
}

impl From<Plane> for PlaneSet {
    fn from(plane: Plane) -> Self {
        Self(1 << plane.index())
    }
}
