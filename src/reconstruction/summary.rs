//! The slices of a plane in numbers.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::ReportRow;
use crate::geometry::Plane;

/// How the slices of one plane fared.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct PlaneSummary {
    /// The plane.
    pub plane: Plane,
    /// Slices of the volume in that plane.
    pub slices: u64,
    /// Those that have a contour.
    pub with_contour: u64,
    /// Those whose contour went into the cloud.
    pub accepted: u64,
    /// Rejected slices by reason; reasons that did not occur are left out.
    pub rejected: BTreeMap<String, u64>,
}

impl PlaneSummary {
    /// One for each plane, in the order of [`Plane::ALL`].
    pub(super) fn of(rows: &[ReportRow]) -> Vec<Self> {
        Plane::ALL.map(|plane| Self::of_plane(plane, rows)).into()
    }

    fn of_plane(plane: Plane, rows: &[ReportRow]) -> Self {
        let mut summary = Self { plane, slices: 0, with_contour: 0, accepted: 0, rejected: BTreeMap::new() };
        for row in rows.iter().filter(|row| row.plane == plane) {
            summary.slices += 1;
            summary.with_contour += u64::from(row.contour_area.is_some());
            match row.reason {
                None => summary.accepted += 1,
                Some(reason) => *summary.rejected.entry(reason.name().to_owned()).or_default() += 1,
            }
        }
        summary
    }
}
