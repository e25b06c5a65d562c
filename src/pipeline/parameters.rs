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

use serde::{Deserialize, Serialize};

use super::precise::QualityLimits;
use super::thresholds::Thresholds;
use crate::observer::Stage;

/// Which pipeline runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Profile {
    /// The published algorithm, decision by decision.
    Paper,
    /// The whole skin in its true place, with a normal and an expected error for each point and a
    /// verdict on the whole: levels and rules derived from the scan.
    // The default of everything that does not say which: this attribute, and `profile` in
    // `config/triplanar.toml`, which a test holds to it.
    #[default]
    Precise,
}

impl Profile {
    /// All profiles.
    pub const ALL: [Self; 2] = [Self::Paper, Self::Precise];

    /// Memory that a reconstruction takes at its peak for each voxel, bytes: the volume of 16 bits and
    /// what the steps make of it. Measured on a 512 × 512 × 145 head at leaves of 1 and 0.2 mm: 2.9 and
    /// 3.3 (`paper`), 12.0 and 12.6 (`precise`).
    #[must_use]
    pub fn bytes_a_voxel(self) -> u64 {
        match self {
            Self::Paper => 4,
            Self::Precise => 13,
        }
    }

    /// The stages of a reconstruction with this profile, in their order.
    #[must_use]
    pub fn stages(self) -> &'static [Stage] {
        use Stage::{
            Axial, Coronal, Crossings, Downsampling, Outliers, Outside, Patient, Reading, Sagittal, Writing,
        };
        match self {
            Self::Paper => &[Reading, Axial, Sagittal, Coronal, Downsampling, Outliers, Writing],
            Self::Precise => &[Reading, Patient, Outside, Crossings, Downsampling, Writing],
        }
    }

    /// The one name in configuration, API, report and command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Precise => "precise",
        }
    }

    /// The algorithm that runs under the profile and its version, as results carry it.
    ///
    /// The version is raised by hand with every change after which the same instances and
    /// parameters give other vertices or other rows in the report: results of an earlier version are
    /// served as they are, and asking for them again makes new ones.
    #[must_use]
    pub fn algorithm(self) -> &'static str {
        match self {
            Self::Paper => "paper/1",
            Self::Precise => "precise/1",
        }
    }
}

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

/// A point is kept if at least `min_neighbours` others lie within `radius_mm` (inclusive).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RadiusOutlier {
    /// mm (published program: 10).
    #[schema(minimum = 0.1, maximum = 100.0)]
    pub radius_mm: f32,
    /// Other points (published program: 250). 0 switches the filter off.
    #[schema(minimum = 0, maximum = 100_000)]
    pub min_neighbours: u32,
}

impl Default for RadiusOutlier {
    fn default() -> Self {
        Self { radius_mm: 10.0, min_neighbours: 250 }
    }
}

/// A point is dropped if its mean distance to its nearest others exceeds mean + `deviations` ·
/// sample standard deviation over all points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StatisticalOutlier {
    /// Nearest others (published program: 20). 0 switches the filter off.
    #[schema(minimum = 0, maximum = 1000)]
    pub neighbours: u32,
    /// Sample standard deviations (published program: 4).
    #[schema(minimum = 0.0, maximum = 1000.0)]
    pub deviations: f64,
}

impl Default for StatisticalOutlier {
    fn default() -> Self {
        Self { neighbours: 20, deviations: 4.0 }
    }
}

/// A parameter outside its range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{name} must be {range}, not {value}")]
pub struct InvalidParameter {
    /// The parameter's name, with dots for nested ones.
    pub name: String,
    /// What would be right.
    pub range: &'static str,
    /// What was given.
    pub value: f64,
}

/// A parameter was changed that the profile does not use.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{name} has no effect under the profile {}: leave it out, or ask for {}", .profile.name(), .other.name())]
pub struct UnusedParameter {
    /// The parameter's name.
    pub name: &'static str,
    /// The profile that would run.
    pub profile: Profile,
    /// The profile that uses it.
    pub other: Profile,
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

pub(super) fn within(
    name: &str,
    value: f64,
    allowed: std::ops::RangeInclusive<f64>,
    range: &'static str,
) -> Result<(), InvalidParameter> {
    if allowed.contains(&value) {
        Ok(())
    } else {
        Err(InvalidParameter { name: name.to_owned(), range, value })
    }
}
