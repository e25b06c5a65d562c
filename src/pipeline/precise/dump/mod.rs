//! What the stages hand on, as files that other programs open: to see where a decision was made.
//!
//! Nobody pays for them who does not ask ([`Observer::stage_files`](crate::observer::Observer::stage_files)).

mod columns;
mod nrrd;
mod ply;

use super::border::Border;
use super::border::crossing::Crossing;
use super::border::rejected::Rejected;
use super::labels::Labels;
use super::labels::air::Air;
use super::labels::label::Label;
use super::rules::Verdicts;
use super::scan::Scan;
use super::skin::Skin;
use crate::observer::StageFile;

/// A stage's result that can be looked at.
pub(super) trait Inspect {
    /// What must hold of it; asked in debug builds.
    ///
    /// # Errors
    /// What does not hold.
    fn check(&self, scan: &Scan<'_>) -> Result<(), String>;
    /// The files that show it.
    fn files(&self, scan: &Scan<'_>) -> Vec<StageFile>;
}

/// Hands a stage's result on, looked at by whoever wants to.
///
/// # Panics
/// In debug builds, if the result breaks what must hold of it.
pub(super) fn inspected<T: Inspect>(scan: &Scan<'_>, result: T) -> T {
    if cfg!(debug_assertions)
        && let Err(broken) = result.check(scan)
    {
        panic!("a stage handed on what can't be: {broken}");
    }
    if let Some(sink) = scan.stage_files() {
        result.files(scan).into_iter().for_each(|file| sink.take(file));
    }
    result
}

/// The value of a cell in `labels.nrrd`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
enum Code {
    AirOutside = 0,
    Canal = 1,
    EnclosedAir = 2,
    Patient = 3,
    OtherBody = 4,
    Attached = 5,
    NotInView = 6,
}

/// The same in words, as it stands in the file's header.
const CODES: &str = "0 air outside, 1 canal, 2 enclosed air, 3 patient, 4 other body, 5 attached to the patient, \
                     6 not in view";

impl Code {
    fn of(label: Label, air: Air) -> Self {
        match (label, air) {
            (Label::Patient, _) => Self::Patient,
            (Label::Other, _) => Self::OtherBody,
            (Label::Attached, _) => Self::Attached,
            (Label::Air, Air::Open) => Self::AirOutside,
            (Label::Air, Air::Canal) => Self::Canal,
            (Label::Air, Air::Enclosed) => Self::EnclosedAir,
            (Label::Air, Air::Solid | Air::Shut) => Self::NotInView,
        }
    }
}

impl Inspect for Labels {
    fn check(&self, _: &Scan<'_>) -> Result<(), String> {
        let cells = self.patient.survey.cells.len();
        for (what, length) in [
            ("labels", self.patient.labels.len()),
            ("marks of what is near something foreign", self.patient.near_foreign.len()),
            ("states of air", self.outside.air().len()),
        ] {
            if length != cells {
                return Err(format!("{length} {what} of {cells} cells"));
            }
        }
        if !self.head.middle.iter().all(|v| v.is_finite()) {
            return Err(format!("the head's middle is {:?}", self.head.middle));
        }
        Ok(())
    }

    fn files(&self, _: &Scan<'_>) -> Vec<StageFile> {
        let survey = &self.patient.survey;
        let codes: Vec<u8> = self
            .patient
            .labels
            .iter()
            .zip(self.outside.air())
            .map(|(&label, &air)| Code::of(label, air) as u8)
            .collect();
        let hu: Vec<u8> = survey.hu.iter().flat_map(|v| v.to_le_bytes()).collect();
        let labels =
            nrrd::encode(&survey.cells, &nrrd::Values { kind: "uint8", meaning: CODES, bytes: &codes });
        let survey = nrrd::encode(&survey.cells, &nrrd::Values { kind: "int16", meaning: "HU", bytes: &hu });
        vec![
            StageFile { name: "labels.nrrd", content: labels },
            StageFile { name: "survey.nrrd", content: survey },
        ]
    }
}

impl Inspect for Border {
    fn check(&self, _: &Scan<'_>) -> Result<(), String> {
        check_places(&self.seen, &self.rejected)
    }

    fn files(&self, _: &Scan<'_>) -> Vec<StageFile> {
        let all = self.with_between.as_ref().unwrap_or(&self.seen);
        vec![StageFile { name: "border.ply", content: ply::encode(&columns::ALL, all, &self.rejected) }]
    }
}

/// What was interpolated between slices and lies under something is left out: it was no measurement.
impl Inspect for Verdicts {
    fn check(&self, _: &Scan<'_>) -> Result<(), String> {
        check_places(self.all(), &self.rejected)
    }

    fn files(&self, _: &Scan<'_>) -> Vec<StageFile> {
        let content = ply::encode(&columns::ALL, self.all(), &self.rejected);
        vec![StageFile { name: "verdicts.ply", content }]
    }
}

impl Inspect for Skin {
    fn check(&self, _: &Scan<'_>) -> Result<(), String> {
        let unlikely = self.points.iter().find(|point| !(point.error.is_finite() && point.error > 0.0));
        unlikely.map_or(Ok(()), |point| Err(format!("a point with the expected error {} mm", point.error)))
    }

    /// None: the cloud itself shows it.
    fn files(&self, _: &Scan<'_>) -> Vec<StageFile> {
        Vec::new()
    }
}

/// Places are finite, normals of unit length, expected errors above zero.
fn check_places(crossings: &[Crossing], rejected: &[Rejected]) -> Result<(), String> {
    let places = crossings.iter().map(|c| (c.place, c.normal));
    for (place, normal) in places.chain(rejected.iter().map(|r| (r.place, r.normal))) {
        let length: f64 = normal.iter().map(|v| v * v).sum();
        if !(place.iter().all(|v| v.is_finite()) && (length - 1.0).abs() < 1e-6) {
            return Err(format!("the place {place:?} with the normal {normal:?}"));
        }
    }
    match crossings.iter().find(|c| !(c.error.is_finite() && c.error >= 0.0)) {
        Some(crossing) => Err(format!("a crossing with the expected error {} mm", crossing.error)),
        None => Ok(()),
    }
}
