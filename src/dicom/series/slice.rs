//! The candidates for slices of the volume, each with what it takes from its instance.

use super::SeriesError;
use super::frame::{Frame, Geometry, Instance};
use super::ignored::Ignored;
use crate::dicom::uid::{FrameOfReferenceUid, SeriesInstanceUid, SopInstanceUid};
use crate::geometry::Vec3;
use crate::store::UnfitReason;

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

/// The slices of the instances that can be some, and what is none. Among real CT slices, an instance
/// that is none (a localizer, a screen shot, a dose report) is left out; if there are only such, all
/// stay and the checks say what is wrong with them.
pub(super) fn candidates(instances: &[Instance]) -> Result<(Vec<Slice>, Vec<Ignored>), SeriesError> {
    if instances.iter().all(|instance| !instance.has_pixel_data) {
        let uids = instances.iter().map(|instance| instance.sop_instance_uid.clone()).collect();
        return Err(SeriesError::new("no_pixel_data", "no instance has pixel data; send the images", uids));
    }
    let any_is_ct = instances.iter().any(is_ct_slice);
    let (mut slices, mut ignored) = (Vec::new(), Vec::new());
    for (source, instance) in instances.iter().enumerate() {
        if !instance.has_pixel_data || (any_is_ct && !is_ct_slice(instance)) {
            ignored.push(Ignored::whole(instance));
            continue;
        }
        let localizers: Vec<_> = instance.frames.iter().filter(|frame| frame.is_localizer).collect();
        if !localizers.is_empty() {
            ignored.push(Ignored::new(instance, UnfitReason::Localizer, &localizers));
        }
        for (frame_index, frame) in
            instance.frames.iter().enumerate().filter(|(_, frame)| !frame.is_localizer)
        {
            slices.push(Slice {
                source,
                frame_index,
                frame: frame.clone(),
                number: instance.number,
                sop_instance_uid: instance.sop_instance_uid.clone(),
                series_instance_uid: instance.series_instance_uid.clone(),
                frame_of_reference_uid: instance.frame_of_reference_uid.clone(),
                matrix: instance.matrix,
            });
        }
    }
    Ok((slices, ignored))
}

/// Refuses a series that is not computed tomography.
pub(super) fn only_ct(instances: &[Instance]) -> Result<(), SeriesError> {
    if instances.iter().any(is_ct_slice) {
        return Ok(());
    }
    let uids = instances.iter().map(|instance| instance.sop_instance_uid.clone()).collect();
    Err(SeriesError::new("not_ct", "no instance is a CT slice; send the original CT series", uids))
}

fn is_ct_slice(instance: &Instance) -> bool {
    super::ignored::reason(instance).is_none()
}
