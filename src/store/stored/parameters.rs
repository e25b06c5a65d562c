//! [`Parameters`] in a row, in a report, and as the text that their identity is made from.

use super::value::Name;
use super::{Schema, Unreadable, of_0_1, stored};
use crate::pipeline::paper::contour::ContourThresholds;
use crate::pipeline::paper::rules::{
    AreaJumpThresholds, AreaOverThresholds, AxialIntensityThresholds, AxialMidLeftThresholds,
    FourDirectionThresholds, LastRowThresholds, LowerBandThresholds, RowCrossingsLowerThresholds,
    RowCrossingsUpperThresholds, SolidityAfterJumpThresholds, SolidityThresholds,
};
use crate::pipeline::parameters::{RadiusOutlier, StatisticalOutlier};
use crate::pipeline::precise::QualityLimits;
use crate::pipeline::{Parameters, Profile, Thresholds};

const SCHEMA: Schema = Schema { what: "parameters", steps: &[of_0_1] };

stored! {
    /// Schema 1. Without the number and in this order it is the text whose hash was the identity of
    /// parameters in 0.1 (see [`super::identity`]).
    ParametersV1 is Parameters {
        profile: Name<Profile>,
        hu_min: i32,
        hu_max: i32,
        leaf_mm: f32,
        radius_outlier: RadiusOutlierV1,
        statistical_outlier: StatisticalOutlierV1,
        unique_distance_mm: f32,
        thresholds: ThresholdsV1,
        quality: QualityLimitsV1,
    }
}

stored! {
    RadiusOutlierV1 is RadiusOutlier { radius_mm: f32, min_neighbours: u32 }
}

stored! {
    StatisticalOutlierV1 is StatisticalOutlier { neighbours: u32, deviations: f64 }
}

stored! {
    ThresholdsV1 is Thresholds {
        contour: ContourV1,
        solidity: SolidityV1,
        four_direction: FourDirectionV1,
        area_over: AreaOverV1,
        area_jump: AreaJumpV1,
        solidity_after_jump: SolidityAfterJumpV1,
        row_crossings_upper: RowCrossingsUpperV1,
        row_crossings_lower: RowCrossingsLowerV1,
        axial_intensity: AxialIntensityV1,
        lower_band: LowerBandV1,
        last_row: LastRowV1,
        axial_mid_left: AxialMidLeftV1,
    }
}

stored! {
    ContourV1 is ContourThresholds {
        min_area: f64,
        axial_window_min: f64,
        axial_window_max: f64,
        upright_window_min_column: f64,
        upright_window_max_column: f64,
        upright_window_min_row: f64,
    }
}

stored! {
    SolidityV1 is SolidityThresholds { min_area: f64, min_solidity: f64 }
}

stored! {
    FourDirectionV1 is FourDirectionThresholds { step: u32 }
}

stored! {
    AreaOverV1 is AreaOverThresholds { max_area: f64 }
}

stored! {
    AreaJumpV1 is AreaJumpThresholds { min_change: f64, ignored_change: f64, max_change: f64 }
}

stored! {
    SolidityAfterJumpV1 is SolidityAfterJumpThresholds { min_solidity: f64 }
}

stored! {
    RowCrossingsUpperV1 is RowCrossingsUpperThresholds {
        min_area: f64,
        first_row: u32,
        sagittal_row_step: u32,
        coronal_row_step: u32,
        sagittal_crossings: u32,
        coronal_crossings: u32,
        gap: u32,
        bad_rows: u32,
    }
}

stored! {
    RowCrossingsLowerV1 is RowCrossingsLowerThresholds {
        min_area: f64,
        row_step: u32,
        margin: u32,
        fallback_margin: u32,
        gap: u32,
        crossings: u32,
        bad_rows: u32,
    }
}

stored! {
    AxialIntensityV1 is AxialIntensityThresholds {
        min_area: f64,
        row_step: u32,
        gap: u32,
        window: u32,
        min_intensity: u32,
        relief: u32,
        count: u32,
        bad_rows: u32,
    }
}

stored! {
    LowerBandV1 is LowerBandThresholds { max_area: f64, rows: u32 }
}

stored! {
    LastRowV1 is LastRowThresholds { max_area: f64 }
}

stored! {
    AxialMidLeftV1 is AxialMidLeftThresholds { max_area: f64, width_divisor: u32 }
}

stored! {
    QualityLimitsV1 is QualityLimits {
        cut_cm2: f64,
        slice_mm: f64,
        noise_hu: f64,
        metal_cm3: f64,
        motion_mm: f64,
        coverage: f64,
        least_coverage: f64,
        disagreement_mm: f64,
        most_disagreement_mm: f64,
    }
}

/// As they are stored now.
pub(crate) fn write(parameters: &Parameters) -> String {
    super::text(&SCHEMA.write::<ParametersV1, _>(parameters))
}

/// As any version stored them.
pub(crate) fn read(json: &str) -> Result<Parameters, Unreadable> {
    SCHEMA.read::<ParametersV1, _>(json.as_bytes())
}
