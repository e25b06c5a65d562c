//! The two pipelines.

use serde::{Deserialize, Serialize};

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
            Self::Precise => "precise/2",
        }
    }
}
