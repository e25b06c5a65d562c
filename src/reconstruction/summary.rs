//! The slices of a plane in numbers.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::ReportRow;
use crate::geometry::Plane;
use crate::pipeline::{Decision, Reason};

/// How the slices of one plane fared.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct PlaneSummary {
    /// The plane.
    pub plane: Plane,
    /// Slices of the volume in that plane.
    pub slices: u64,
    /// Those that have a contour.
    pub with_contour: u64,
    /// Those whose contour, or a part of it, went into the cloud.
    pub accepted: u64,
    /// Of these, those of which a part was rejected; profile `precise` alone.
    pub partly: u64,
    /// Rejected slices by reason; reasons that did not occur are left out.
    pub rejected: BTreeMap<String, u64>,
    /// Accepted contour of all slices, mm; profile `precise` alone.
    pub accepted_mm: Option<f64>,
    /// Rejected contour of all slices, mm; profile `precise` alone.
    pub rejected_mm: Option<f64>,
    /// Rejected contour by the reason of its stretches, mm; empty under `paper`.
    #[serde(default)]
    pub stretches_mm: BTreeMap<String, f64>,
}

impl PlaneSummary {
    /// One for each plane, in the order of [`Plane::ALL`].
    pub(super) fn of(rows: &[ReportRow]) -> Vec<Self> {
        Plane::ALL.map(|plane| Self::of_plane(plane, rows)).into()
    }

    fn of_plane(plane: Plane, rows: &[ReportRow]) -> Self {
        let mut summary = Self {
            plane,
            slices: 0,
            with_contour: 0,
            accepted: 0,
            partly: 0,
            rejected: BTreeMap::new(),
            accepted_mm: None,
            rejected_mm: None,
            stretches_mm: BTreeMap::new(),
        };
        let add = |sum: &mut Option<f64>, part: Option<f64>| {
            if let Some(part) = part {
                *sum = Some(sum.unwrap_or(0.0) + part);
            }
        };
        for row in rows.iter().filter(|row| row.plane == plane) {
            summary.slices += 1;
            summary.with_contour += u64::from(row.reason != Some(Reason::NoContour));
            summary.partly += u64::from(row.decision == Decision::Partly);
            match row.reason {
                None => summary.accepted += 1,
                Some(reason) => *summary.rejected.entry(reason.name().to_owned()).or_default() += 1,
            }
            add(&mut summary.accepted_mm, row.accepted_mm);
            add(&mut summary.rejected_mm, row.rejected_mm);
            for stretch in &row.stretches {
                let name = Reason::Stretch(stretch.reason).name().to_owned();
                *summary.stretches_mm.entry(name).or_default() += stretch.length_mm;
            }
        }
        summary
    }
}
