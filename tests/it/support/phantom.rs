//! A series that costs little: 512 × 512 pixels, because the published thresholds are in pixels of
//! such an image, but few slices.

use std::sync::OnceLock;

use triplanar::phantom::{Options, Phantom};

use super::service::Settings;

/// The slices of [`small`].
pub(crate) const SLICES: usize = 12;

/// A series of Part 10 files.
#[derive(Debug, Clone)]
pub(crate) struct Series {
    /// Its Series Instance UID.
    pub(crate) uid: String,
    /// Its instances.
    pub(crate) files: Vec<Vec<u8>>,
}

/// [`SLICES`] slices around the eyes; made once.
pub(crate) fn small() -> &'static Series {
    static SERIES: OnceLock<Series> = OnceLock::new();
    SERIES.get_or_init(|| {
        series(Options { slices: SLICES, slice_mm: 5.0, top_mm: 40.0, noise_hu: 0.0, ..Options::default() })
    })
}

/// The series of these options.
pub(crate) fn series(options: Options) -> Series {
    let phantom = Phantom::new(options).expect("valid options");
    let uid = phantom.identity().series_instance_uid.to_string();
    Series { uid, files: phantom.instances().into_iter().map(|(_, bytes)| bytes).collect() }
}

/// Settings under which [`small`] gives a cloud: it is no whole head, and its slices are too far
/// apart for the published radius filter.
pub(crate) fn settings() -> Settings {
    Settings::new().with("pipeline.profile", "paper").with("pipeline.radius_outlier.min_neighbours", "0")
}
