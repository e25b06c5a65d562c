//! How far the result can be trusted, told from the scan alone.

use serde::{Deserialize, Serialize};

/// What a user should make of the cloud.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The whole skin in view, well resolved.
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
    /// The scan ends within the skull: face and chin are not in view.
    CutBelow,
    /// The patient leaves the image at a side.
    CutAtSide,
    /// Slices lie further apart than the limit.
    ThickSlices,
    /// Noise above the limit.
    Noise,
    /// Metal in or on the head.
    Metal,
    /// Too much of the skin in view could not be accepted.
    Coverage,
    /// The planes disagree about the skin.
    Disagreement,
}

/// The limits of the verdict.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct QualityLimits {
    /// Largest cut through the patient at a side of the scan that still counts as none, cm².
    pub cut_cm2: f64,
    /// Thickest slice spacing of a good result, mm.
    pub slice_mm: f64,
    /// Most noise of a good result, HU.
    pub noise_hu: f64,
    /// Most metal of a good result, cm³.
    pub metal_cm3: f64,
    /// Least share of the skin in view that a good result holds.
    pub coverage: f64,
    /// Below this share the result is insufficient.
    pub least_coverage: f64,
    /// Largest 95th percentile of the planes' disagreement in a good result, mm.
    pub disagreement_mm: f64,
}

impl Default for QualityLimits {
    fn default() -> Self {
        Self {
            cut_cm2: 2.0,
            slice_mm: 2.5,
            noise_hu: 40.0,
            metal_cm3: 0.5,
            coverage: 0.97,
            least_coverage: 0.5,
            disagreement_mm: 0.3,
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
    /// Share of the skin in view that was accepted, by area.
    pub coverage: f64,
    /// Skin that was seen and rejected, cm².
    pub rejected_cm2: f64,
    /// Mean distance of a point from the surface of its neighbours of all lines, mm.
    pub agreement_mean_mm: f64,
    /// 95th percentile of it, mm.
    pub agreement_p95_mm: f64,
    /// Noise, HU.
    pub noise_hu: f64,
    /// Width of the edge (standard deviation) in the slices, mm.
    pub edge_in_plane_mm: f64,
    /// The same across the slices, mm.
    pub edge_across_mm: f64,
    /// Widest slice spacing, mm.
    pub slice_mm: f64,
    /// Cut through the patient above, below (within the skull) and at the sides, cm².
    pub cut_cm2: [f64; 3],
    /// Metal, cm³.
    pub metal_cm3: f64,
}

impl Quality {
    /// Holds what was measured against the limits.
    pub(super) fn judge(&mut self, limits: &QualityLimits) {
        let cuts = [Doubt::CutAbove, Doubt::CutBelow, Doubt::CutAtSide];
        let mut doubts: Vec<Doubt> = cuts
            .into_iter()
            .zip(self.cut_cm2)
            .filter(|(_, cut)| *cut > limits.cut_cm2)
            .map(|(d, _)| d)
            .collect();
        let others = [
            (Doubt::ThickSlices, self.slice_mm > limits.slice_mm),
            (Doubt::Noise, self.noise_hu > limits.noise_hu),
            (Doubt::Metal, self.metal_cm3 > limits.metal_cm3),
            (Doubt::Coverage, self.coverage < limits.coverage),
            (Doubt::Disagreement, self.agreement_p95_mm > limits.disagreement_mm),
        ];
        doubts.extend(others.into_iter().filter(|o| o.1).map(|o| o.0));
        self.verdict = if self.coverage < limits.least_coverage {
            Verdict::Insufficient
        } else if doubts.is_empty() {
            Verdict::Good
        } else {
            Verdict::Limited
        };
        self.doubts = doubts;
    }
}
