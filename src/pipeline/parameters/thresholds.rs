//! Every threshold that decides about a slice, with the paper's value as its default.

use serde::{Deserialize, Serialize};

use super::invalid::{InvalidParameter, within};
use crate::pipeline::paper::contour::ContourThresholds;
use crate::pipeline::paper::rules::{
    AreaJumpThresholds, AreaOverThresholds, AxialIntensityThresholds, AxialMidLeftThresholds,
    FourDirectionThresholds, LastRowThresholds, LowerBandThresholds, RowCrossingsLowerThresholds,
    RowCrossingsUpperThresholds, SolidityAfterJumpThresholds, SolidityThresholds,
};

/// The thresholds of contour selection and of the tests, in the order of the tests (paper, section
/// 2.2). Lengths and areas are in pixels of the slice, made for 512 × 512 images of about 0.45 mm.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Thresholds {
    /// Which contours may belong to the head.
    pub contour: ContourThresholds,
    /// Test 1.
    pub solidity: SolidityThresholds,
    /// Test 2.
    pub four_direction: FourDirectionThresholds,
    /// Test 3.
    pub area_over: AreaOverThresholds,
    /// When tests 2 to 5 are made, and test 4.
    pub area_jump: AreaJumpThresholds,
    /// Test 5.
    pub solidity_after_jump: SolidityAfterJumpThresholds,
    /// Test 6.
    pub row_crossings_upper: RowCrossingsUpperThresholds,
    /// Test 7.
    pub row_crossings_lower: RowCrossingsLowerThresholds,
    /// Test 8.
    pub axial_intensity: AxialIntensityThresholds,
    /// Test 9.
    pub lower_band: LowerBandThresholds,
    /// Test 10.
    pub last_row: LastRowThresholds,
    /// Test 11.
    pub axial_mid_left: AxialMidLeftThresholds,
}

impl Thresholds {
    /// Checks every range.
    ///
    /// # Errors
    /// The first threshold outside its range.
    pub(crate) fn check(&self) -> Result<(), InvalidParameter> {
        let upper = &self.row_crossings_upper;
        let lower = &self.row_crossings_lower;
        let intensity = &self.axial_intensity;
        for (name, area) in [
            ("thresholds.contour.min_area", self.contour.min_area),
            ("thresholds.solidity.min_area", self.solidity.min_area),
            ("thresholds.area_over.max_area", self.area_over.max_area),
            ("thresholds.area_jump.min_change", self.area_jump.min_change),
            ("thresholds.area_jump.ignored_change", self.area_jump.ignored_change),
            ("thresholds.area_jump.max_change", self.area_jump.max_change),
            ("thresholds.row_crossings_upper.min_area", upper.min_area),
            ("thresholds.row_crossings_lower.min_area", lower.min_area),
            ("thresholds.axial_intensity.min_area", intensity.min_area),
            ("thresholds.lower_band.max_area", self.lower_band.max_area),
            ("thresholds.last_row.max_area", self.last_row.max_area),
            ("thresholds.axial_mid_left.max_area", self.axial_mid_left.max_area),
        ] {
            within(name, area, 0.0..=1e9, "within 0 to 1000000000 px²")?;
        }
        for (name, solidity) in [
            ("thresholds.solidity.min_solidity", self.solidity.min_solidity),
            ("thresholds.solidity_after_jump.min_solidity", self.solidity_after_jump.min_solidity),
        ] {
            within(name, solidity, 0.0..=1.0, "within 0 to 1")?;
        }
        for (name, place) in [
            ("thresholds.contour.axial_window_min", self.contour.axial_window_min),
            ("thresholds.contour.axial_window_max", self.contour.axial_window_max),
            ("thresholds.contour.upright_window_min_column", self.contour.upright_window_min_column),
            ("thresholds.contour.upright_window_max_column", self.contour.upright_window_max_column),
            ("thresholds.contour.upright_window_min_row", self.contour.upright_window_min_row),
        ] {
            within(name, place, -1e6..=1e6, "within -1000000 to 1000000 px")?;
        }
        for (name, count) in [
            ("thresholds.row_crossings_upper.first_row", upper.first_row),
            ("thresholds.row_crossings_upper.sagittal_crossings", upper.sagittal_crossings),
            ("thresholds.row_crossings_upper.coronal_crossings", upper.coronal_crossings),
            ("thresholds.row_crossings_upper.gap", upper.gap),
            ("thresholds.row_crossings_lower.margin", lower.margin),
            ("thresholds.row_crossings_lower.fallback_margin", lower.fallback_margin),
            ("thresholds.row_crossings_lower.gap", lower.gap),
            ("thresholds.row_crossings_lower.crossings", lower.crossings),
            ("thresholds.axial_intensity.gap", intensity.gap),
            ("thresholds.axial_intensity.min_intensity", intensity.min_intensity),
            ("thresholds.axial_intensity.relief", intensity.relief),
            ("thresholds.lower_band.rows", self.lower_band.rows),
        ] {
            within(name, f64::from(count), 0.0..=1e6, "within 0 to 1000000")?;
        }
        for (name, count) in [
            ("thresholds.four_direction.step", self.four_direction.step),
            ("thresholds.row_crossings_upper.sagittal_row_step", upper.sagittal_row_step),
            ("thresholds.row_crossings_upper.coronal_row_step", upper.coronal_row_step),
            ("thresholds.row_crossings_upper.bad_rows", upper.bad_rows),
            ("thresholds.row_crossings_lower.row_step", lower.row_step),
            ("thresholds.row_crossings_lower.bad_rows", lower.bad_rows),
            ("thresholds.axial_intensity.row_step", intensity.row_step),
            ("thresholds.axial_intensity.window", intensity.window),
            ("thresholds.axial_intensity.count", intensity.count),
            ("thresholds.axial_intensity.bad_rows", intensity.bad_rows),
            ("thresholds.axial_mid_left.width_divisor", self.axial_mid_left.width_divisor),
        ] {
            within(name, f64::from(count), 1.0..=1e6, "within 1 to 1000000")?;
        }
        Ok(())
    }
}
