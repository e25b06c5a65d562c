//! Why a slice, or a stretch of its contour, was rejected: one name for each reason, everywhere.

use serde::{Deserialize, Serialize};
use utoipa::openapi::schema::{ObjectBuilder, Schema};
use utoipa::openapi::{RefOr, Type};
use utoipa::{PartialSchema, ToSchema};

use crate::pipeline::precise::StretchReason;

/// A test of the paper that a slice failed (numbered in the order in which they are made), or why
/// nothing of the contour was accepted under `precise`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// No contour is large and central enough (`paper`); the slice does not meet the patient's border
    /// (`precise`).
    NoContour,
    /// Test 1: solidity below the limit for a large contour (paper, Algorithm 2).
    Solidity,
    /// Test 2: tissue outside the contour below its centroid (paper, Algorithm 3).
    FourDirectionDown,
    /// Test 2, above the centroid.
    FourDirectionUp,
    /// Test 2, right of the centroid.
    FourDirectionRight,
    /// Test 2, left of the centroid.
    FourDirectionLeft,
    /// Test 3: after a jump, the area is too large.
    #[serde(rename = "area_over_120000")]
    AreaOver120000,
    /// Test 4: the area jumped too far from the carried area.
    #[serde(rename = "area_jump_80000")]
    AreaJump80000,
    /// Test 5: after a jump, solidity below the lower limit.
    #[serde(rename = "solidity_0_75")]
    Solidity075,
    /// Test 6: too many rows of the upper half cross the contour too often.
    RowCrossingsUpper,
    /// Test 7: the same in the lower half.
    RowCrossingsLower,
    /// Test 8: inner contours seen by the local mean of the filled image.
    AxialIntensity,
    /// Test 9: a small contour reaches the last rows.
    #[serde(rename = "lower_band_30_rows")]
    LowerBand30Rows,
    /// Test 10: a contour that is not large reaches the last row.
    LastRow,
    /// Test 11: a small contour reaches far to the left in the middle row.
    AxialMidLeft,
    /// That of the longest of the stretches, all of which were rejected (`precise`).
    #[serde(untagged)]
    Stretch(StretchReason),
}

impl Reason {
    /// The reasons of `paper`, in the order of the tests.
    pub const PAPER: [Self; 15] = [
        Self::NoContour,
        Self::Solidity,
        Self::FourDirectionDown,
        Self::FourDirectionUp,
        Self::FourDirectionRight,
        Self::FourDirectionLeft,
        Self::AreaOver120000,
        Self::AreaJump80000,
        Self::Solidity075,
        Self::RowCrossingsUpper,
        Self::RowCrossingsLower,
        Self::AxialIntensity,
        Self::LowerBand30Rows,
        Self::LastRow,
        Self::AxialMidLeft,
    ];

    /// The name in report, metrics and docs.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Stretch(reason) => reason.name(),
            Self::NoContour => "no_contour",
            Self::Solidity => "solidity",
            Self::FourDirectionDown => "four_direction_down",
            Self::FourDirectionUp => "four_direction_up",
            Self::FourDirectionRight => "four_direction_right",
            Self::FourDirectionLeft => "four_direction_left",
            Self::AreaOver120000 => "area_over_120000",
            Self::AreaJump80000 => "area_jump_80000",
            Self::Solidity075 => "solidity_0_75",
            Self::RowCrossingsUpper => "row_crossings_upper",
            Self::RowCrossingsLower => "row_crossings_lower",
            Self::AxialIntensity => "axial_intensity",
            Self::LowerBand30Rows => "lower_band_30_rows",
            Self::LastRow => "last_row",
            Self::AxialMidLeft => "axial_mid_left",
        }
    }
}

/// A text: the name of a test, or that of a stretch's reason.
impl PartialSchema for Reason {
    fn schema() -> RefOr<Schema> {
        let stretches = StretchReason::ALL.map(|reason| serde_json::Value::from(reason.name()));
        let names = Self::PAPER.map(|reason| serde_json::Value::from(reason.name()));
        let about = "Why a slice was rejected: the test of the profile `paper` that it failed, or, under \
                     `precise`, the reason of the longest of its rejected stretches.";
        ObjectBuilder::new()
            .schema_type(Type::String)
            .description(Some(about))
            .enum_values(Some(names.into_iter().chain(stretches)))
            .into()
    }
}

impl ToSchema for Reason {}

/// One failed test: what was measured, and the limit that it had to keep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rejection {
    /// Which test.
    pub reason: Reason,
    /// What was measured, in the unit of the test (px, px², rows, a ratio).
    pub measured: f64,
    /// The limit it was held against, in the same unit.
    pub limit: f64,
}

impl Rejection {
    /// A rejection by a count.
    #[expect(clippy::cast_precision_loss, reason = "counts of pixels and rows are far below 2^53")]
    pub(crate) fn count(reason: Reason, measured: usize, limit: u32) -> Self {
        Self { reason, measured: measured as f64, limit: f64::from(limit) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reason_has_one_name_in_json_schema_and_metrics() {
        let RefOr::T(Schema::Object(schema)) = Reason::schema() else { panic!("a text") };
        let names = schema.enum_values.expect("names");
        assert!(names.len() > Reason::PAPER.len(), "the stretches' reasons too");
        for name in &names {
            let reason: Reason = serde_json::from_value(name.clone()).expect("a reason");
            assert_eq!(serde_json::to_value(reason).expect("a text"), *name);
            assert_eq!(reason.name(), name.as_str().expect("a text"));
        }
        let unique: std::collections::HashSet<_> = names.iter().map(ToString::to_string).collect();
        assert_eq!(unique.len(), names.len());
    }
}
