//! The candidates for slices of the volume, each with what it takes from its instance.

use super::frame::{Frame, Geometry, Instance};
use super::{SeriesError, Warning, WarningCode};
use crate::dicom::sop_class;
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

/// The slices of the instances that can be some. Among real CT slices, an instance that is none
/// (a localizer, a screen shot, a dose report) is left out with a warning; if there are only such,
/// all stay and the checks say what is wrong with them.
pub(super) fn candidates(
    instances: &[Instance],
    warnings: &mut Vec<Warning>,
) -> Result<Vec<Slice>, SeriesError> {
    if instances.iter().all(|instance| !instance.has_pixel_data) {
        let uids = instances.iter().map(|instance| instance.sop_instance_uid.clone()).collect();
        return Err(SeriesError::new("no_pixel_data", "no instance has pixel data; send the images", uids));
    }
    let any_is_ct = instances.iter().any(is_ct_slice);
    let mut slices = Vec::new();
    let mut ignored = 0;
    for (source, instance) in instances.iter().enumerate() {
        if !instance.has_pixel_data || (any_is_ct && !is_ct_slice(instance)) {
            ignored += 1;
            continue;
        }
        for (frame_index, frame) in instance.frames.iter().enumerate() {
            if frame.is_localizer {
                ignored += 1;
                continue;
            }
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
    if ignored > 0 {
        warnings.push(Warning {
            code: WarningCode::IgnoredInstances,
            detail: format!(
                "{ignored} images are no slices (localizers, secondary captures, without pixels)"
            ),
        });
    }
    Ok(slices)
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
    let is_ct_class = instance.sop_class_uid.as_ref().is_none_or(sop_class::is_accepted);
    let is_ct = instance.modality.as_deref().is_none_or(|modality| modality == "CT");
    is_ct_class && is_ct && instance.has_pixel_data && !super::unfit::is_no_scan(&instance.image_type)
}
