//! [`Quality`] in a row.

use super::value::Name;
use super::{Schema, Unreadable, of_0_1, stored};
use crate::pipeline::precise::{Doubt, Missing, Quality, Side, SideQuality, StretchReason, Verdict};

const SCHEMA: Schema = Schema { what: "quality", steps: &[of_0_1] };

stored! {
    /// Schema 1.
    QualityV1 is Quality {
        verdict: Name<Verdict>,
        doubts: Vec<Name<Doubt>>,
        coverage: f64,
        missing: Vec<MissingV1>,
        agreement_mean_mm: f64,
        agreement_p95_mm: f64,
        sides: Vec<SideV1>,
        noise_hu: f64,
        #[serde(default)]
        clipped_air: bool,
        edge_in_plane_mm: f64,
        edge_across_mm: f64,
        slice_mm: f64,
        motion_mm: f64,
        cut_above_cm2: f64,
        cut_below_cm2: f64,
        cut_at_side_cm2: f64,
        metal_cm3: f64,
        #[serde(default)]
        doubtful_slices: usize,
    }
}

stored! {
    MissingV1 is Missing { side: Name<Side>, reason: Name<StretchReason>, area_cm2: f64 }
}

stored! {
    SideV1 is SideQuality {
        side: Name<Side>,
        area_cm2: f64,
        coverage: Option<f64>,
        agreement_mean_mm: Option<f64>,
        agreement_p95_mm: Option<f64>,
    }
}

/// As it is stored now.
pub(crate) fn write(quality: &Quality) -> String {
    super::text(&SCHEMA.write::<QualityV1, _>(quality))
}

/// As any version stored it.
pub(crate) fn read(json: &str) -> Result<Quality, Unreadable> {
    SCHEMA.read::<QualityV1, _>(json.as_bytes())
}
