//! Instances of the series that are no slices of it.

use super::frame::{Frame, Geometry, Instance};
use super::line::OFF_LINE;
use super::slice::Slice;
use super::unfit::Facts;
use super::{IgnoredInstance, Warning, WarningCode};
use crate::dicom::series::UnfitReason;
use crate::geometry::{Vec3, add, dot, norm, scale, sub};

/// Cosine of the angle up to which directions are taken for one, about 2.6 degrees.
const PARALLEL: f64 = 0.999;
/// An instance nearer to a slice than this part of the step is a picture of that slice.
const OWN: f64 = 0.25;

/// An instance of which all or some frames are left out.
#[derive(Debug, Clone)]
pub(super) struct Ignored {
    pub(super) instance: IgnoredInstance,
    matrix: Option<(u16, u16)>,
    places: Vec<Geometry>,
}

impl Ignored {
    /// Some or all frames of it.
    pub(super) fn new(instance: &Instance, reason: UnfitReason, frames: &[&Frame]) -> Self {
        Self {
            instance: IgnoredInstance { sop_instance_uid: instance.sop_instance_uid.clone(), reason },
            matrix: instance.matrix,
            places: frames.iter().filter_map(|frame| frame.geometry).collect(),
        }
    }

    /// Whether it lies parallel to the slices of that normal, between two places along it.
    pub(super) fn lies_between(&self, from: f64, to: f64, normal: Vec3) -> bool {
        self.places.iter().any(|place| {
            let along = dot(place.position, normal);
            dot(place.normal(), normal) > PARALLEL && from < along && along < to
        })
    }

    /// Whether it lies, with their matrix, where a slice of its own would lie between these two
    /// neighbours.
    pub(super) fn stands_between(&self, before: &Slice, after: &Slice, normal: Vec3) -> bool {
        let (from, to) = (before.geometry(), after.geometry());
        let (start, end) = (before.along(normal), after.along(normal));
        self.matrix == before.matrix
            && self.places.iter().any(|place| {
                let part = (dot(place.position, normal) - start) / (end - start);
                let on_the_line = add(from.position, scale(sub(to.position, from.position), part));
                (OWN..=1.0 - OWN).contains(&part)
                    && dot(place.along_row, from.along_row) > PARALLEL
                    && dot(place.down_column, from.down_column) > PARALLEL
                    && norm(sub(place.position, on_the_line)) < OFF_LINE
            })
    }
}

/// Why an instance is no slice of a CT; `None` if it is one.
pub(super) fn reason(instance: &Instance) -> Option<UnfitReason> {
    let facts = Facts {
        sop_class_uid: instance.sop_class_uid.as_ref(),
        modality: instance.modality.as_deref(),
        has_pixel_data: instance.has_pixel_data,
        image_type: &instance.image_type,
        photometric: instance.photometric.as_deref(),
        samples_per_pixel: instance.samples_per_pixel,
        has_position: Some(instance.has_position),
    };
    facts.no_slice()
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
    warnings.push(Warning { code: WarningCode::IgnoredInstances, detail, instances, rows: Vec::new() });
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
