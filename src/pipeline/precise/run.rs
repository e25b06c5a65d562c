//! The five stages of the profile, each of which hands its result to the next.

use super::border::Border;
use super::dump::inspected;
use super::labels::Labels;
use super::no_skin::NoSkin;
use super::report::quality::QualityLimits;
use super::rules::{AT_FIRST_SIGHT, Verdicts};
use super::scan::Scan;
use super::scan::empty_ends::without_empty_ends;
use super::skin::{Skin, Wish};
use crate::dicom::Volume;
use crate::observer::Observer;
use crate::observer::stop::unless_stopped;

/// The skin of the head in `volume`, one point for each leaf of `leaf_mm`.
///
/// # Errors
/// Why there is no skin in it, or that the observer asked to stop.
pub fn reconstruct(
    volume: &Volume,
    leaf_mm: f64,
    limits: &QualityLimits,
    observer: &dyn Observer,
) -> Result<Skin, NoSkin> {
    let wish = Wish { leaf_mm, limits, doubtful_slices: volume.doubtful_slices.len() };
    unless_stopped(|| stages(volume, &wish, observer)).unwrap_or(Err(NoSkin::Cancelled))
}

fn stages(volume: &Volume, wish: &Wish<'_>, observer: &dyn Observer) -> Result<Skin, NoSkin> {
    let slices = without_empty_ends(volume, observer)?;
    let scan = Scan::of(&slices, observer)?;
    let labels = inspected(&scan, Labels::of(&scan)?);
    let border = inspected(&scan, Border::of(&scan, labels, &AT_FIRST_SIGHT)?);
    let verdicts = inspected(&scan, Verdicts::of(&scan, border));
    let skin = inspected(&scan, Skin::of(&scan, &verdicts, wish));
    verdicts.free(scan.sampler.asked());
    Ok(skin.counted_from(scan.sampler.slice_axis(), slices.first))
}
