//! The second stage: what every cell of the scan is: the patient, a device, air outside, a canal.

pub(crate) mod air;
pub(crate) mod body;
pub(crate) mod canals;
pub(crate) mod crop;
pub(crate) mod devices;
pub(crate) mod field_border;
pub(crate) mod head;
pub(crate) mod label;
pub(crate) mod outside;
pub(crate) mod patient;
pub(crate) mod slender;

use super::no_skin::NoSkin;
use super::scan::Scan;
use crate::observer::Stage;
use air::Air;
use head::Head;
use label::Label;
use outside::Outside;
use patient::Patient;
use slender::Slender;

/// What surrounds nothing stands higher over what the ball leaves, mm.
/// Measured by `tools/skin_model/slender.py` (FINDINGS.md): of the points on the cords of a real head 0.85 lie
/// within 3.5 mm of what does, of its skin 0.006.
const OF_LEDGE_MM: f64 = 0.9;
/// Less soft tissue within bone than this is no head, cm³.
const LEAST_BRAIN_CM3: f64 = 200.0;

/// What the scan shows where, in cells of 1 mm.
#[derive(Debug)]
pub(crate) struct Labels {
    /// Which tissue is the patient, and which a device.
    pub(crate) patient: Patient,
    /// Where the head is, and where it ends.
    pub(crate) head: Head,
    /// Which air is outside, and which a canal.
    pub(crate) outside: Outside,
    /// What surrounds nothing, slender as it is; not looked for where slices lie far apart.
    pub(crate) slender: Option<Slender>,
}

impl Labels {
    /// Labels the cells of a scan of a head.
    ///
    /// # Errors
    /// [`NoSkin::NoPatient`], [`NoSkin::NoHead`].
    pub(crate) fn of(scan: &Scan<'_>) -> Result<Self, NoSkin> {
        let patient = Patient::find(scan).ok_or(NoSkin::NoPatient)?;
        scan.tell(Stage::Patient, 1.0);
        let head = Head::of(scan, &patient);
        if head.brain_cm3 < LEAST_BRAIN_CM3 {
            return Err(NoSkin::NoHead { brain_cm3: head.brain_cm3, limit_cm3: LEAST_BRAIN_CM3 });
        }
        let asked = scan.sampler.asked();
        let outside = Outside::find(asked, &patient.survey, &patient.labels, &patient.field_border);
        scan.tell(Stage::Outside, 1.0);
        let (labels, air) = (&patient.labels, outside.air());
        let solid =
            |i: usize| matches!(labels[i], Label::Patient | Label::Attached) || air[i] == Air::Enclosed;
        let slender = Slender::find(&scan.sampler, patient.survey.cells, OF_LEDGE_MM, solid);
        Ok(Self { patient, head, outside, slender: slender.map(|(slender, _)| slender) })
    }
}
