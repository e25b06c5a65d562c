//! Whether a series is one from which a head can be reconstructed, by its headers alone.

use crate::dicom::header::InstanceHeader;
use crate::dicom::sop_class;
use crate::dicom::uid::SopClassUid;
use crate::named::named;

named! {
    /// Why a series is kept but not reconstructed.
    UnfitReason {
        /// Modality is not CT.
        NotCt = "not_ct",
        /// Image Type says LOCALIZER.
        Localizer = "localizer",
        /// Image Type says that it is derived from a display, not a scan.
        SecondaryCapture = "secondary_capture",
        /// Fewer slices than `intake.min_slices`.
        TooFewSlices = "too_few_slices",
        /// No instance has pixels.
        NoPixelData = "no_pixel_data",
        /// Photometric Interpretation or Samples per Pixel tells a picture in colour, or one with a
        /// palette: a screen save, a rendering.
        Colour = "colour",
        /// A derived or secondary image that says nothing of its place in the patient.
        NoPlace = "no_place",
    }
}

/// Why the series of these instances is kept but not reconstructed, or `None` if it can be tried.
///
/// Localizers (PS3.3 section C.8.2.1.1.1: Image Type value 3 `LOCALIZER`), secondary captures and
/// pictures in colour among real slices don't count; a series of nothing else is one. `min_slices` is the setting
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
        UnfitReason::Colour => format!("of {all} instances, all that could be slices are in colour"),
        UnfitReason::NoPlace => format!("of {all} instances, all that could be slices are without a place"),
        UnfitReason::TooFewSlices => format!("{slices} slices, intake.min_slices is {min_slices}"),
    })
}

/// Why an instance with that header is no slice of its series; `None` if it can be one.
pub(crate) fn no_slice(header: &InstanceHeader) -> Option<UnfitReason> {
    Facts::from(header).no_slice()
}

/// The reason, and the number of slices.
fn judged(headers: &[InstanceHeader], min_slices: usize) -> Option<(UnfitReason, u64)> {
    let reasons: Vec<_> = headers.iter().map(|header| Facts::from(header).no_slice()).collect();
    if reasons.iter().all(Option::is_some) {
        // The instance that comes nearest to a slice says why there is none.
        let reason = reasons.into_iter().flatten().max_by_key(|reason| rank(*reason));
        return Some((reason.unwrap_or(UnfitReason::NotCt), 0));
    }
    let slices = headers.iter().zip(reasons).filter(|(_, reason)| reason.is_none());
    let slices: u64 = slices.map(|(header, _)| u64::from(header.frames)).sum();
    (slices < min_slices as u64).then_some((UnfitReason::TooFewSlices, slices))
}

/// What tells a slice of a CT from what else a series holds. One judgement for the headers in the
/// catalog and for the instances that a volume is read from.
pub(super) struct Facts<'a> {
    pub(super) sop_class_uid: Option<&'a SopClassUid>,
    pub(super) modality: Option<&'a str>,
    pub(super) has_pixel_data: bool,
    pub(super) image_type: &'a [String],
    pub(super) photometric: Option<&'a str>,
    pub(super) samples_per_pixel: Option<u16>,
    /// Whether position or orientation stands in the data set itself, where that is known.
    pub(super) has_position: Option<bool>,
}

impl<'a> From<&'a InstanceHeader> for Facts<'a> {
    fn from(header: &'a InstanceHeader) -> Self {
        Self {
            sop_class_uid: Some(&header.sop_class_uid),
            modality: header.modality.as_deref(),
            has_pixel_data: header.has_pixel_data,
            image_type: &header.image_type,
            photometric: header.photometric.as_deref(),
            samples_per_pixel: header.samples_per_pixel,
            has_position: header.has_position,
        }
    }
}

impl Facts<'_> {
    /// Why it is no slice; `None` if it can be one.
    pub(super) fn no_slice(&self) -> Option<UnfitReason> {
        ORDER.into_iter().find(|reason| self.is(*reason))
    }

    fn is(&self, reason: UnfitReason) -> bool {
        match reason {
            UnfitReason::NotCt => {
                self.modality.is_some_and(|modality| modality != "CT")
                    || !self.sop_class_uid.is_none_or(sop_class::is_accepted)
            }
            UnfitReason::NoPixelData => !self.has_pixel_data,
            UnfitReason::Localizer => says(self.image_type, &LOCALIZER),
            UnfitReason::SecondaryCapture => says(self.image_type, &SECONDARY_CAPTURE),
            UnfitReason::Colour => {
                self.samples_per_pixel.is_some_and(|samples| samples > 1)
                    || self.photometric.is_some_and(is_colour)
            }
            UnfitReason::NoPlace => {
                let is_single_frame = self.sop_class_uid.is_some_and(sop_class::is_single_frame);
                let value = |index: usize| self.image_type.get(index).map(String::as_str);
                let is_made_of_others = value(0) == Some("DERIVED") || value(1) == Some("SECONDARY");
                is_single_frame && is_made_of_others && self.has_position == Some(false)
            }
            UnfitReason::TooFewSlices => false,
        }
    }
}

/// The order in which an instance is asked.
const ORDER: [UnfitReason; 6] = [
    UnfitReason::NotCt,
    UnfitReason::NoPixelData,
    UnfitReason::Localizer,
    UnfitReason::SecondaryCapture,
    UnfitReason::Colour,
    UnfitReason::NoPlace,
];

fn rank(reason: UnfitReason) -> usize {
    ORDER.iter().position(|other| *other == reason).unwrap_or_default()
}

const LOCALIZER: [&str; 1] = ["LOCALIZER"];
/// What scanners and workstations write on screen shots and on pictures of the dose.
const SECONDARY_CAPTURE: [&str; 5] =
    ["SECONDARY CAPTURE", "SCREEN SAVE", "SCREENSAVE", "SCREENSHOT", "DOSE_INFO"];

fn says(image_type: &[String], words: &[&str]) -> bool {
    image_type.iter().any(|value| words.iter().any(|word| value.eq_ignore_ascii_case(word)))
}

/// The photometric interpretations of PS3.3 section C.7.6.3.1.2 that are no gray values, with the
/// retired ones.
fn is_colour(photometric: &str) -> bool {
    matches!(photometric, "PALETTE COLOR" | "RGB" | "HSV" | "ARGB" | "CMYK" | "XYB")
        || photometric.starts_with("YBR_")
}
