//! How far the result can be trusted, told from the scan alone.

use serde::{Deserialize, Serialize};

use super::sides::Side;
use crate::pipeline::precise::reason::StretchReason;

/// What a user should make of the cloud.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The whole skin of the head in view, well resolved.
    Good,
    /// Usable with the reasons in mind.
    Limited,
    /// Not fit for registration.
    Insufficient,
}

/// Why a verdict is not `good`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Doubt {
    /// The scan ends above the patient's vertex.
    CutAbove,
    /// The scan ends within the head: the chin is not in view.
    CutBelow,
    /// The head leaves the image at a side.
    CutAtSide,
    /// Slices lie further apart than the limit.
    ThickSlices,
    /// Noise above the limit.
    Noise,
    /// The scan shows no measured air: all of it has one value.
    ClippedAir,
    /// Metal in or on the head.
    Metal,
    /// The patient moved between two slices, or the table did.
    Motion,
    /// Too much of the skin in view could not be accepted.
    Coverage,
    /// The planes disagree about the skin.
    Disagreement,
    /// Slices don't go with their neighbours, as those of damaged data do: the warning
    /// `inconsistent_levels` names them.
    InconsistentLevels,
}

/// The limits of the verdict.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct QualityLimits {
    /// Largest cut through the head by a border of the scan that still counts as none, cm².
    #[schema(minimum = 0.0, maximum = 1_000_000.0)]
    pub cut_cm2: f64,
    /// Thickest slice spacing of a good result, mm.
    #[schema(minimum = 0.0, maximum = 1_000_000.0)]
    pub slice_mm: f64,
    /// Most noise of a good result, HU.
    #[schema(minimum = 0.0, maximum = 1_000_000.0)]
    pub noise_hu: f64,
    /// Most metal of a good result, cm³.
    #[schema(minimum = 0.0, maximum = 1_000_000.0)]
    pub metal_cm3: f64,
    /// How far a slice may stand aside from its neighbours in a good result, mm.
    #[schema(minimum = 0.0, maximum = 1_000_000.0)]
    pub motion_mm: f64,
    /// Least share of the skin in view that a good result holds.
    #[schema(minimum = 0.0, maximum = 1.0)]
    pub coverage: f64,
    /// Below this share the result is insufficient.
    #[schema(minimum = 0.0, maximum = 1.0)]
    pub least_coverage: f64,
    /// Largest 95th percentile of the planes' disagreement in a good result, mm.
    #[schema(minimum = 0.0, maximum = 1_000_000.0)]
    pub disagreement_mm: f64,
    /// Above this one the result is insufficient, mm.
    #[schema(minimum = 0.0, maximum = 1_000_000.0)]
    pub most_disagreement_mm: f64,
}

impl Default for QualityLimits {
    fn default() -> Self {
        Self {
            cut_cm2: 0.5,
            slice_mm: 2.5,
            noise_hu: 40.0,
            metal_cm3: 0.5,
            motion_mm: 0.35,
            coverage: 0.95,
            least_coverage: 0.5,
            disagreement_mm: 0.3,
            most_disagreement_mm: 1.0,
        }
    }
}

/// What was measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Quality {
    /// The verdict.
    pub verdict: Verdict,
    /// Its reasons; empty for `good`.
    pub doubts: Vec<Doubt>,
    /// Estimated share of the head's skin in view that was accepted, by area, 0 to 1.
    pub coverage: f64,
    /// Where the rest is.
    pub missing: Vec<Missing>,
    /// Mean distance of a point from the surface of its neighbours on lines of all directions, mm.
    pub agreement_mean_mm: f64,
    /// 95th percentile of it, mm.
    pub agreement_p95_mm: f64,
    /// The same side by side.
    pub sides: Vec<SideQuality>,
    /// Noise in air, or in soft tissue where the air is clipped, HU.
    pub noise_hu: f64,
    /// Whether all of the air has one value although the tissue has noise: something filled it, and the
    /// foot of every edge with it.
    #[serde(default)]
    pub clipped_air: bool,
    /// Width of the edge (standard deviation) in the slices, mm.
    pub edge_in_plane_mm: f64,
    /// The same across the slices, mm.
    pub edge_across_mm: f64,
    /// Widest slice spacing, mm.
    pub slice_mm: f64,
    /// How far at most a slice's outline stands aside from between its neighbours, mm: a patient who
    /// moved (a lasting step shows with half its length).
    pub motion_mm: f64,
    /// Cut through the head by the scan's upper end, cm².
    pub cut_above_cm2: f64,
    /// Cut through the head by its lower end, cm²: none where the neck is in view.
    pub cut_below_cm2: f64,
    /// Cut through the head at the sides of the images, cm².
    pub cut_at_side_cm2: f64,
    /// Metal, cm³.
    pub metal_cm3: f64,
    /// Slices that don't go with their neighbours, as those of damaged data do.
    #[serde(default, skip_serializing_if = "is_none")]
    pub doubtful_slices: usize,
}

/// Skin of the head that is in view but not in the cloud.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Missing {
    /// Where.
    pub side: Side,
    /// Why.
    pub reason: StretchReason,
    /// How much, cm².
    pub area_cm2: f64,
}

/// One side of the head.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct SideQuality {
    /// Which.
    pub side: Side,
    /// Accepted skin, cm².
    pub area_cm2: f64,
    /// Share of its skin in view that was accepted, 0 to 1; `null` if there is none in view.
    pub coverage: Option<f64>,
    /// Mean distance of its points from the surface of their neighbours, mm; `null` without points.
    pub agreement_mean_mm: Option<f64>,
    /// 95th percentile of it, mm.
    pub agreement_p95_mm: Option<f64>,
}

/// Whether there are none: a report without them is as it was before they were counted.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_none(slices: &usize) -> bool {
    *slices == 0
}

impl Quality {
    /// Holds what was measured against the limits.
    pub(crate) fn judge(mut self, limits: &QualityLimits) -> Self {
        let held = [
            (Doubt::CutAbove, self.cut_above_cm2 > limits.cut_cm2),
            (Doubt::CutBelow, self.cut_below_cm2 > limits.cut_cm2),
            (Doubt::CutAtSide, self.cut_at_side_cm2 > limits.cut_cm2),
            (Doubt::ThickSlices, self.slice_mm > limits.slice_mm),
            (Doubt::Noise, self.noise_hu > limits.noise_hu),
            (Doubt::ClippedAir, self.clipped_air),
            (Doubt::Metal, self.metal_cm3 > limits.metal_cm3),
            (Doubt::Motion, self.motion_mm > limits.motion_mm),
            (Doubt::Coverage, self.coverage < limits.coverage),
            (Doubt::Disagreement, self.agreement_p95_mm > limits.disagreement_mm),
            (Doubt::InconsistentLevels, self.doubtful_slices > 0),
        ];
        self.doubts = held.into_iter().filter(|h| h.1).map(|h| h.0).collect();
        let unfit =
            self.coverage < limits.least_coverage || self.agreement_p95_mm > limits.most_disagreement_mm;
        self.verdict = match self.doubts.as_slice() {
            _ if unfit => Verdict::Insufficient,
            [] => Verdict::Good,
            _ => Verdict::Limited,
        };
        self
    }
}
