//! Instances of the series that are no slices of it.

use super::frame::{Frame, Geometry, Instance};
use super::{IgnoredInstance, Warning, WarningCode};
use crate::dicom::sop_class;
use crate::geometry::{Vec3, dot};
use crate::store::UnfitReason;

/// An instance of which all or some frames are left out.
#[derive(Debug, Clone)]
pub(super) struct Ignored {
    pub(super) instance: IgnoredInstance,
    places: Vec<Geometry>,
}

impl Ignored {
    /// A whole instance.
    pub(super) fn whole(instance: &Instance) -> Self {
        let reason = reason(instance).unwrap_or(UnfitReason::NotCt);
        Self::new(instance, reason, &instance.frames.iter().collect::<Vec<_>>())
    }

    /// Some frames of it.
    pub(super) fn new(instance: &Instance, reason: UnfitReason, frames: &[&Frame]) -> Self {
        Self {
            instance: IgnoredInstance { sop_instance_uid: instance.sop_instance_uid.clone(), reason },
            places: frames.iter().filter_map(|frame| frame.geometry).collect(),
        }
    }

    /// Whether it lies parallel to the slices of that normal, between two places along it.
    pub(super) fn lies_between(&self, from: f64, to: f64, normal: Vec3) -> bool {
        self.places.iter().any(|place| {
            let along = dot(place.position, normal);
            dot(place.normal(), normal) > 0.999 && from < along && along < to
        })
    }
}

/// Why an instance is no slice of a CT; `None` if it is one. The order is that of
/// [`unfit`](super::unfit()).
pub(super) fn reason(instance: &Instance) -> Option<UnfitReason> {
    let is_ct_class = instance.sop_class_uid.as_ref().is_none_or(sop_class::is_accepted);
    let is_ct = instance.modality.as_deref().is_none_or(|modality| modality == "CT");
    if !is_ct_class || !is_ct {
        Some(UnfitReason::NotCt)
    } else if !instance.has_pixel_data {
        Some(UnfitReason::NoPixelData)
    } else {
        super::unfit::no_scan(&instance.image_type)
    }
}

/// Warns of what was left out, each by its UID and with the reason.
pub(super) fn warn(ignored: &[Ignored], warnings: &mut Vec<Warning>) {
    if ignored.is_empty() {
        return;
    }
    let mut instances: Vec<_> = ignored.iter().map(|ignored| ignored.instance.clone()).collect();
    instances.sort();
    let detail =
        format!("{} instances are no slices and were left out: {}", instances.len(), counted(ignored));
    warnings.push(Warning { code: WarningCode::IgnoredInstances, detail, instances });
}

/// How many for each reason, as `2 localizer, 1 no_pixel_data`.
pub(super) fn counted(ignored: &[Ignored]) -> String {
    let count = |reason: UnfitReason| ignored.iter().filter(|one| one.instance.reason == reason).count();
    let counts: Vec<_> = UnfitReason::ALL
        .iter()
        .map(|reason| (count(*reason), reason.name()))
        .filter(|(count, _)| *count > 0)
        .map(|(count, name)| format!("{count} {name}"))
        .collect();
    counts.join(", ")
}
