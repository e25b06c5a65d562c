//! The parameters that can be given as flags; what is not given is the configuration's.

use crate::cli::{Failed, values};
use crate::pipeline::{Parameters, Profile};

#[derive(Debug, clap::Args)]
pub(super) struct Thresholds {
    /// Which pipeline; the flags below but --leaf belong to the profile `paper`
    #[arg(long, value_parser = values::profile())]
    profile: Option<Profile>,
    /// Lowest Hounsfield unit of tissue
    #[arg(long, value_name = "HU", allow_negative_numbers = true)]
    hu_min: Option<i32>,
    /// Highest Hounsfield unit of tissue
    #[arg(long, value_name = "HU", allow_negative_numbers = true)]
    hu_max: Option<i32>,
    /// Edge of a voxel-grid cell, or of the leaf that has one point
    #[arg(long, value_name = "MM")]
    leaf: Option<f32>,
    /// Radius outlier removal: how far neighbours may be
    #[arg(long, value_name = "MM")]
    radius: Option<f32>,
    /// Radius outlier removal: neighbours that a point needs; 0 switches it off
    #[arg(long, value_name = "N")]
    min_neighbours: Option<u32>,
    /// Statistical outlier removal: neighbours looked at; 0 switches it off
    #[arg(long, value_name = "N")]
    neighbours: Option<u32>,
    /// Statistical outlier removal: standard deviations that a point may be off
    #[arg(long, value_name = "X")]
    deviations: Option<f64>,
}

impl Thresholds {
    /// Lays the flags over the configuration's parameters.
    pub(super) fn over(&self, configured: &Parameters) -> Result<Parameters, Failed> {
        let mut parameters = configured.clone();
        set(&mut parameters.profile, self.profile);
        set(&mut parameters.hu_min, self.hu_min);
        set(&mut parameters.hu_max, self.hu_max);
        set(&mut parameters.leaf_mm, self.leaf);
        set(&mut parameters.radius_outlier.radius_mm, self.radius);
        set(&mut parameters.radius_outlier.min_neighbours, self.min_neighbours);
        set(&mut parameters.statistical_outlier.neighbours, self.neighbours);
        set(&mut parameters.statistical_outlier.deviations, self.deviations);
        parameters.check().map_err(Failed::usage)?;
        parameters.check_use(configured).map_err(Failed::usage)?;
        Ok(parameters)
    }
}

fn set<T>(value: &mut T, given: Option<T>) {
    if let Some(given) = given {
        *value = given;
    }
}
