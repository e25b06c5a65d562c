//! Series → [`Volume`]: sorting, geometry, Hounsfield units.

mod error;
mod unfit;
mod warning;

use super::Volume;
use super::scan::Limits;
use super::source::InstanceSource;
use crate::pipeline::Observer;

pub use error::SeriesError;
pub use unfit::unfit;
pub use warning::{Warning, WarningCode};

/// What a series may be at most, and must be at least.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReadLimits {
    /// Voxels of the volume (setting `jobs.max_voxels`).
    pub max_voxels: u64,
    /// Slices that a volume needs; never fewer than 2.
    pub min_slices: usize,
    /// Of each instance.
    pub scan: Limits,
}

impl Default for ReadLimits {
    fn default() -> Self {
        Self { max_voxels: 1 << 30, min_slices: 3, scan: Limits::default() }
    }
}

/// Reads the instances of one series into a volume.
///
/// # Errors
/// [`SeriesError`]: the series is no volume whose geometry can be trusted, or can't be decoded.
pub fn read(
    source: &dyn InstanceSource,
    limits: &ReadLimits,
    observer: &dyn Observer,
) -> Result<(Volume, Vec<Warning>), SeriesError> {
    let _ = (source, limits, observer);
    unimplemented!("reading a series")
}
