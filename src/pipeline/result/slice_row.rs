//! The decision on one slice.

use serde::{Deserialize, Serialize};

use super::rejection::Rejection;
use crate::geometry::Plane;
use crate::pipeline::precise::Stretch;

/// What became of a slice's contour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Decision {
    /// All of it went into the cloud.
    Accepted,
    /// Some stretches of it were rejected; the rest went into the cloud. Profile `precise` alone.
    Partly,
    /// Nothing of it went into the cloud.
    Rejected,
}

/// The decision on one slice.
#[derive(Debug, Clone, PartialEq)]
pub struct SliceRow {
    /// The plane.
    pub plane: Plane,
    /// Index within the plane: axial from the top, sagittal from the patient's right, coronal from
    /// the back.
    pub index: usize,
    /// Why nothing of it was accepted; `None` if anything was. Of several rejected stretches it is
    /// the longest one's.
    pub rejection: Option<Rejection>,
    /// Area of the cut contour in px², if there is one.
    pub contour_area: Option<f64>,
    /// Contour area / area of its convex hull.
    pub solidity: Option<f64>,
    /// Number of pixels of the cut contour (`paper`), or of crossings of the patient's border with
    /// the slice's grid lines (`precise`).
    pub contour_points: usize,
    /// Carried area before and after the slice, px².
    pub carried_area: (Option<f64>, Option<f64>),
    /// Accepted contour, mm; profile `precise` alone.
    pub accepted_mm: Option<f64>,
    /// The stretches of the contour that were rejected; profile `precise` alone.
    pub stretches: Vec<Stretch>,
}

impl SliceRow {
    /// What became of the contour.
    #[must_use]
    pub fn decision(&self) -> Decision {
        match self.rejection {
            Some(_) => Decision::Rejected,
            None if self.stretches.is_empty() => Decision::Accepted,
            None => Decision::Partly,
        }
    }
}
