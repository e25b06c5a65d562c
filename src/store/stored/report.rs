//! [`Report`] in its file.

use std::collections::BTreeMap;

use super::figures::FiguresV1;
use super::parameters::ParametersV1;
use super::quality::QualityV1;
use super::value::Name;
use super::{Schema, Unreadable, of_0_1, stored};
use crate::dicom::series::UnfitReason;
use crate::dicom::series::{DoubtfulRows, IgnoredInstance, RowsDoubt, Warning, WarningCode};
use crate::dicom::uid::{FrameOfReferenceUid, SeriesInstanceUid, SopInstanceUid, StudyInstanceUid};
use crate::geometry::Plane;
use crate::pipeline::precise::{Stretch, StretchReason};
use crate::pipeline::{Decision, Reason};
use crate::reconstruction::{
    Identity, PlaneSummary, RefusedInstance, Report, ReportError, ReportRow, UnusedFile, VolumeSummary,
};

const SCHEMA: Schema = Schema { what: "report", steps: &[of_0_1] };

stored! {
    /// Schema 1.
    ReportV1 is Report {
        software: String,
        algorithm: Option<String>,
        identity: IdentityV1,
        parameters: ParametersV1,
        error: Option<ErrorV1>,
        volume: VolumeV1,
        figures: FiguresV1,
        quality: Option<QualityV1>,
        planes: Vec<PlaneV1>,
        warnings: Vec<WarningV1>,
        refused: Vec<RefusedV1>,
        #[serde(default)]
        unused: Vec<UnusedV1>,
        slices: Vec<RowV1>,
    }
}

stored! {
    IdentityV1 is Identity {
        study_instance_uid: Option<Name<StudyInstanceUid>>,
        series_instance_uid: Name<SeriesInstanceUid>,
        frame_of_reference_uid: Option<Name<FrameOfReferenceUid>>,
    }
}

stored! {
    ErrorV1 is ReportError { code: String, detail: String }
}

stored! {
    VolumeV1 is VolumeSummary { shape: [usize; 3], step_mm: [f64; 3], acquired: Name<Plane> }
}

stored! {
    PlaneV1 is PlaneSummary {
        plane: Name<Plane>,
        slices: u64,
        with_contour: u64,
        accepted: u64,
        partly: u64,
        rejected: BTreeMap<String, u64>,
        accepted_mm: Option<f64>,
        rejected_mm: Option<f64>,
        #[serde(default)]
        stretches_mm: BTreeMap<String, f64>,
    }
}

stored! {
    WarningV1 is Warning {
        code: Name<WarningCode>,
        detail: String,
        #[serde(default)]
        instances: Vec<IgnoredV1>,
        #[serde(default)]
        rows: Vec<DoubtfulV1>,
    }
}

stored! {
    DoubtfulV1 is DoubtfulRows {
        sop_instance_uid: Name<SopInstanceUid>,
        frame: usize,
        first_row: usize,
        last_row: usize,
        doubt: Name<RowsDoubt>,
        measured: f64,
        limit: f64,
    }
}

stored! {
    IgnoredV1 is IgnoredInstance { sop_instance_uid: Name<SopInstanceUid>, reason: Name<UnfitReason> }
}

stored! {
    RefusedV1 is RefusedInstance { sop_instance_uid: Name<SopInstanceUid>, code: String, times: u64 }
}

stored! {
    UnusedV1 is UnusedFile { name: String, code: String, detail: String }
}

stored! {
    RowV1 is ReportRow {
        plane: Name<Plane>,
        index: usize,
        accepted: bool,
        reason: Option<Name<Reason>>,
        measured: Option<f64>,
        limit: Option<f64>,
        contour_area: Option<f64>,
        solidity: Option<f64>,
        contour_points: usize,
        carried_area_before: Option<f64>,
        carried_area_after: Option<f64>,
        position_mm: f64,
        sop_instance_uid: Option<Name<SopInstanceUid>>,
        decision: Name<Decision>,
        accepted_mm: Option<f64>,
        rejected_mm: Option<f64>,
        #[serde(default)]
        stretches: Vec<StretchV1>,
    }
}

stored! {
    StretchV1 is Stretch { reason: Name<StretchReason>, length_mm: f64, measured: f64, limit: f64 }
}

/// As it is stored now.
pub(crate) fn write(report: &Report) -> Vec<u8> {
    super::text(&SCHEMA.write::<ReportV1, _>(report)).into_bytes()
}

/// As any version stored it.
pub(crate) fn read(json: &[u8]) -> Result<Report, Unreadable> {
    SCHEMA.read::<ReportV1, _>(json)
}
