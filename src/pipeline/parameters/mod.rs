//! Every parameter of the pipeline, with the paper's value as its default where the paper has one.
//!
//! | parameter | `paper` | `precise` |
//! |---|---|---|
//! | `leaf_mm` | edge of a cell of the voxel grids | one point for each leaf, on the skin |
//! | `unique_distance_mm` | yes | yes |
//! | `hu_min`, `hu_max` | the mask's HU range | not used: its levels come from the scan |
//! | `radius_outlier`, `statistical_outlier` | yes | not used |
//! | `thresholds` | yes | not used: its rules are in mm, from the scan |
//! | `quality` | not used | the limits of the verdict |

pub mod invalid;
pub mod outliers;
pub mod profile;
pub mod thresholds;

pub use invalid::{InvalidParameter, UnusedParameter};
pub use outliers::{RadiusOutlier, StatisticalOutlier};
pub use profile::Profile;
pub use thresholds::Thresholds;

use serde::{Deserialize, Serialize};

use crate::pipeline::precise::QualityLimits;
use invalid::within;

/// The parameters of one reconstruction. Two jobs on the same instances with equal parameters are
/// the same reconstruction. In a request every field may be left out: the service's configured
/// value is used then.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Parameters {
    /// Which pipeline runs.
    pub profile: Profile,
    /// Lowest Hounsfield unit of tissue (paper: −200). Profile `paper` alone.
    #[schema(minimum = -32768, maximum = 32767)]
    pub hu_min: i32,
    /// Highest Hounsfield unit of tissue (paper: 220). Profile `paper` alone.
    #[schema(minimum = -32768, maximum = 32767)]
    pub hu_max: i32,
    /// Edge of a voxel-grid cell (`paper`), or of the leaf that has one point (`precise`), mm (paper:
    /// 1).
    #[schema(minimum = 0.05, maximum = 20.0)]
    pub leaf_mm: f32,
    /// Radius outlier removal. Profile `paper` alone.
    pub radius_outlier: RadiusOutlier,
    /// Statistical outlier removal. Profile `paper` alone.
    pub statistical_outlier: StatisticalOutlier,
    /// A point is unique if no axial point lies nearer than this, mm (paper: 1).
    #[schema(minimum = 0.0, maximum = 1000.0)]
    pub unique_distance_mm: f32,
    /// Which contours are kept and which slices are rejected. Profile `paper` alone.
    pub thresholds: Thresholds,
    /// The limits of the verdict. Profile `precise` alone.
    pub quality: QualityLimits,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            profile: Profile::default(),
            hu_min: -200,
            hu_max: 220,
            leaf_mm: 1.0,
            radius_outlier: RadiusOutlier::default(),
            statistical_outlier: StatisticalOutlier::default(),
            unique_distance_mm: 1.0,
            thresholds: Thresholds::default(),
            quality: QualityLimits::default(),
        }
    }
}

impl Parameters {
    /// The published algorithm with its published values.
    #[must_use]
    pub fn paper() -> Self {
        Self { profile: Profile::Paper, ..Self::default() }
    }

    /// The profile `precise` with its default values.
    #[must_use]
    pub fn precise() -> Self {
        Self { profile: Profile::Precise, ..Self::default() }
    }

    /// The same with what has no effect under the profile at its default.
    #[must_use]
    pub fn effective(&self) -> Self {
        let default = Self::default();
        match self.profile {
            Profile::Paper => Self { quality: default.quality, ..self.clone() },
            Profile::Precise => Self {
                hu_min: default.hu_min,
                hu_max: default.hu_max,
                radius_outlier: default.radius_outlier,
                statistical_outlier: default.statistical_outlier,
                thresholds: default.thresholds,
                ..self.clone()
            },
        }
    }

    /// Checks that what differs from the `configured` parameters has an effect.
    ///
    /// # Errors
    /// The first parameter that was changed and that the profile does not use.
    pub fn check_use(&self, configured: &Self) -> Result<(), UnusedParameter> {
        let paper = [
            ("hu_min", self.hu_min != configured.hu_min),
            ("hu_max", self.hu_max != configured.hu_max),
            ("radius_outlier", self.radius_outlier != configured.radius_outlier),
            ("statistical_outlier", self.statistical_outlier != configured.statistical_outlier),
            ("thresholds", self.thresholds != configured.thresholds),
        ];
        let precise = [("quality", self.quality != configured.quality)];
        let (unused, other) = match self.profile {
            Profile::Paper => (&precise[..], Profile::Precise),
            Profile::Precise => (&paper[..], Profile::Paper),
        };
        match unused.iter().find(|(_, changed)| *changed) {
            Some((name, _)) => Err(UnusedParameter { name, profile: self.profile, other }),
            None => Ok(()),
        }
    }

    /// Checks every range.
    ///
    /// # Errors
    /// The first parameter outside its range.
    pub fn check(&self) -> Result<(), InvalidParameter> {
        let hu = f64::from(i16::MIN)..=f64::from(i16::MAX);
        within("hu_min", f64::from(self.hu_min), hu.clone(), "within -32768 to 32767")?;
        within("hu_max", f64::from(self.hu_max), hu, "within -32768 to 32767")?;
        within("hu_max", f64::from(self.hu_max), f64::from(self.hu_min)..=f64::MAX, "at least hu_min")?;
        within("leaf_mm", f64::from(self.leaf_mm), 0.05..=20.0, "within 0.05 to 20 mm")?;
        let radius = f64::from(self.radius_outlier.radius_mm);
        within("radius_outlier.radius_mm", radius, 0.1..=100.0, "within 0.1 to 100 mm")?;
        let min_neighbours = f64::from(self.radius_outlier.min_neighbours);
        within("radius_outlier.min_neighbours", min_neighbours, 0.0..=1e5, "within 0 to 100000")?;
        let neighbours = f64::from(self.statistical_outlier.neighbours);
        within("statistical_outlier.neighbours", neighbours, 0.0..=1000.0, "within 0 to 1000")?;
        let deviations = self.statistical_outlier.deviations;
        within("statistical_outlier.deviations", deviations, 0.0..=1000.0, "within 0 to 1000")?;
        let unique_distance = f64::from(self.unique_distance_mm);
        within("unique_distance_mm", unique_distance, 0.0..=1000.0, "within 0 to 1000 mm")?;
        self.thresholds.check()?;
        check_quality(&self.quality)
    }
}

/// A limit whose name ends in a unit is a measure, any other a share.
fn check_quality(limits: &QualityLimits) -> Result<(), InvalidParameter> {
    const UNITS: [&str; 5] = ["_mm", "_cm2", "_cm3", "_hu", "_deg"];
    let Ok(serde_json::Value::Object(limits)) = serde_json::to_value(limits) else { return Ok(()) };
    for (name, value) in &limits {
        // What is not finite has become null.
        let value = value.as_f64().unwrap_or(f64::NAN);
        let (allowed, range) = if UNITS.iter().any(|unit| name.ends_with(unit)) {
            (0.0..=1e6, "within 0 to 1000000")
        } else {
            (0.0..=1.0, "a share within 0 to 1")
        };
        within(&format!("quality.{name}"), value, allowed, range)?;
    }
    Ok(())
}
