//! The candidates for slices of the volume, each with what it takes from its instance.

use super::SeriesError;
use super::frame::{Frame, Geometry, Instance};
use super::ignored::{self, Ignored};
use crate::dicom::series::UnfitReason;
use crate::dicom::uid::{FrameOfReferenceUid, SeriesInstanceUid, SopInstanceUid};
use crate::geometry::Vec3;

/// One slice.
#[derive(Debug, Clone)]
pub(super) struct Slice {
    /// Index of its instance in the source.
    pub(super) source: usize,
    /// Index of its frame in the instance.
    pub(super) frame_index: usize,
    pub(super) frame: Frame,
    /// Instance Number (0020,0013). Tells nothing of the place.
    pub(super) number: Option<i64>,
    pub(super) sop_instance_uid: SopInstanceUid,
    pub(super) series_instance_uid: Option<SeriesInstanceUid>,
    pub(super) frame_of_reference_uid: Option<FrameOfReferenceUid>,
    /// Rows, columns.
    pub(super) matrix: Option<(u16, u16)>,
    /// Bits Stored and Pixel Representation.
    pub(super) format: Option<(u16, u16)>,
    /// Photometric Interpretation of its instance.
    pub(super) photometric: Option<String>,
    /// Its instance went through a lossy compression.
    pub(super) is_lossy: bool,
}

impl Slice {
    /// Its place; slices without one were refused before.
    pub(super) fn geometry(&self) -> Geometry {
        self.frame.geometry.expect("checked before sorting")
    }

    /// Its position along a direction, mm.
    pub(super) fn along(&self, direction: Vec3) -> f64 {
        crate::geometry::dot(self.geometry().position, direction)
    }
}

/// The slices, and what else is among the instances (localizers, screen shots, pictures in colour, dose
/// reports), which is left out. Of a series without any slice, those of another modality stay.
///
/// # Errors
/// There is no slice.
pub(super) fn candidates(instances: &[Instance]) -> Result<(Vec<Slice>, Vec<Ignored>), SeriesError> {
    let all = || instances.iter().map(|instance| instance.sop_instance_uid.clone()).collect();
    if instances.iter().all(|instance| !instance.has_pixel_data) {
        return Err(SeriesError::new("no_pixel_data", "no instance has pixel data; send the images", all()));
    }
    // Where nothing is computed tomography, the checks of the geometry say more than that.
    let any_is_slice = instances.iter().any(|instance| ignored::reason(instance).is_none());
    let stays = |reason| !any_is_slice && reason == UnfitReason::NotCt;
    let (mut slices, mut ignored) = (Vec::new(), Vec::new());
    for (source, instance) in instances.iter().enumerate() {
        let (localizers, frames): (Vec<_>, Vec<_>) =
            instance.frames.iter().enumerate().partition(|(_, frame)| frame.is_localizer);
        if let Some(reason) = ignored::reason(instance).filter(|reason| !stays(*reason)) {
            let frames: Vec<_> = instance.frames.iter().collect();
            ignored.push(Ignored::new(instance, reason, &frames));
            continue;
        }
        if !localizers.is_empty() {
            let frames: Vec<_> = localizers.into_iter().map(|(_, frame)| frame).collect();
            ignored.push(Ignored::new(instance, UnfitReason::Localizer, &frames));
        }
        slices.extend(frames.into_iter().map(|(frame_index, frame)| Slice {
            source,
            frame_index,
            frame: frame.clone(),
            number: instance.number,
            sop_instance_uid: instance.sop_instance_uid.clone(),
            series_instance_uid: instance.series_instance_uid.clone(),
            frame_of_reference_uid: instance.frame_of_reference_uid.clone(),
            matrix: instance.matrix,
            format: instance.format,
            photometric: instance.photometric.clone(),
            is_lossy: instance.is_lossy,
        }));
    }
    if slices.is_empty() {
        let detail = format!(
            "no instance is a slice of a CT ({}); send the original CT series",
            ignored::counted(&ignored)
        );
        return Err(SeriesError::new("not_ct", detail, all()));
    }
    Ok((slices, ignored))
}

/// Refuses a series that is not computed tomography.
pub(super) fn only_ct(instances: &[Instance]) -> Result<(), SeriesError> {
    if instances.iter().any(|instance| ignored::reason(instance).is_none()) {
        return Ok(());
    }
    let uids = instances.iter().map(|instance| instance.sop_instance_uid.clone()).collect();
    Err(SeriesError::new("not_ct", "no instance is a CT slice; send the original CT series", uids))
}
