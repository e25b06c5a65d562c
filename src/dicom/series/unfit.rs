//! Whether a series is one from which a head can be reconstructed, by its headers alone.

use crate::dicom::header::InstanceHeader;
use crate::dicom::sop_class;
use crate::store::UnfitReason;

/// Why the series of these instances is kept but not reconstructed, or `None` if it can be tried.
///
/// Localizers (PS3.3 section C.8.2.1.1.1: Image Type value 3 `LOCALIZER`) and secondary captures
/// among real slices don't count; a series of nothing else is one. `min_slices` is the setting
/// `intake.min_slices`; the frames of a multi-frame instance count each.
#[must_use]
pub fn unfit(headers: &[InstanceHeader], min_slices: usize) -> Option<UnfitReason> {
    judged(headers, min_slices).map(|(reason, _)| reason)
}

/// What [`unfit`] found, with its figures and the limit, as `2 slices, intake.min_slices is 10`.
#[must_use]
pub fn unfit_detail(headers: &[InstanceHeader], min_slices: usize) -> Option<String> {
    let all = headers.len();
    judged(headers, min_slices).map(|(reason, slices)| match reason {
        UnfitReason::NotCt => format!("none of {all} instances is CT"),
        UnfitReason::NoPixelData => format!("none of {all} instances is CT and has pixel data"),
        UnfitReason::Localizer => format!("of {all} instances, all that are images of a CT are localizers"),
        UnfitReason::SecondaryCapture => format!("of {all} instances, none is a slice of a scan"),
        UnfitReason::TooFewSlices => format!("{slices} slices, intake.min_slices is {min_slices}"),
    })
}

/// The reason, and the number of slices.
fn judged(headers: &[InstanceHeader], min_slices: usize) -> Option<(UnfitReason, u64)> {
    let first_of = |reason: fn(&InstanceHeader) -> bool, rest: &mut Vec<&InstanceHeader>| {
        rest.retain(|header| !reason(header));
        rest.is_empty()
    };
    let mut rest: Vec<_> = headers.iter().collect();
    if first_of(|header| !is_ct(header), &mut rest) {
        return Some((UnfitReason::NotCt, 0));
    }
    if first_of(|header| !header.has_pixel_data, &mut rest) {
        return Some((UnfitReason::NoPixelData, 0));
    }
    if first_of(is_localizer, &mut rest) {
        return Some((UnfitReason::Localizer, 0));
    }
    if first_of(is_secondary_capture, &mut rest) {
        return Some((UnfitReason::SecondaryCapture, 0));
    }
    let slices: u64 = rest.iter().map(|header| u64::from(header.frames)).sum();
    (slices < min_slices as u64).then_some((UnfitReason::TooFewSlices, slices))
}

fn is_ct(header: &InstanceHeader) -> bool {
    header.modality.as_deref().is_none_or(|modality| modality == "CT")
        && sop_class::is_accepted(&header.sop_class_uid)
}

fn is_localizer(header: &InstanceHeader) -> bool {
    says(&header.image_type, &LOCALIZER)
}

fn is_secondary_capture(header: &InstanceHeader) -> bool {
    says(&header.image_type, &SECONDARY_CAPTURE)
}

/// What Image Type says that the image is instead of a slice of a scan.
pub(super) fn no_scan(image_type: &[String]) -> Option<UnfitReason> {
    if says(image_type, &LOCALIZER) {
        Some(UnfitReason::Localizer)
    } else if says(image_type, &SECONDARY_CAPTURE) {
        Some(UnfitReason::SecondaryCapture)
    } else {
        None
    }
}

const LOCALIZER: [&str; 1] = ["LOCALIZER"];
/// What scanners and workstations write on screen shots and on pictures of the dose.
const SECONDARY_CAPTURE: [&str; 5] =
    ["SECONDARY CAPTURE", "SCREEN SAVE", "SCREENSAVE", "SCREENSHOT", "DOSE_INFO"];

fn says(image_type: &[String], words: &[&str]) -> bool {
    image_type.iter().any(|value| words.iter().any(|word| value.eq_ignore_ascii_case(word)))
}
