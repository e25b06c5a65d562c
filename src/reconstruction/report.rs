//! What a reconstruction says about itself: counts, warnings, and a row for every slice of every
//! plane. Holds no patient's identity and no time of day.

use serde::{Deserialize, Serialize};

use super::PlaneSummary;
use crate::dicom::Volume;
use crate::dicom::series::Warning;
use crate::dicom::uid::{FrameOfReferenceUid, SeriesInstanceUid, SopInstanceUid, StudyInstanceUid};
use crate::geometry::{Axis, Grid, Plane, norm};
use crate::pipeline::precise::{Quality, Stretch};
use crate::pipeline::{Decision, Figures, Parameters, Reason, SliceRow, slices};

/// The report of one reconstruction, successful or not.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Report {
    /// Name and version of the software that made it.
    pub software: String,
    /// The algorithm and its version, e.g. `precise/1`; absent from reports of 0.1, whose algorithms
    /// are version 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub algorithm: Option<String>,
    /// What was reconstructed.
    pub identity: Identity,
    /// The parameters that were used, all of them.
    pub parameters: Parameters,
    /// Why there is no cloud; absent when there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<ReportError>,
    /// The volume that was cut into slices.
    pub volume: VolumeSummary,
    /// Points after each stage, and the figures of the paper (its section 3).
    pub figures: Figures,
    /// How far the cloud can be trusted: verdict, its reasons and what was measured; `null` under the
    /// profile `paper`.
    pub quality: Option<Quality>,
    /// Slices and rejections of each plane: axial, sagittal, coronal.
    pub planes: Vec<PlaneSummary>,
    /// What was unusual about the series and was dealt with.
    pub warnings: Vec<Warning>,
    /// Instances of the series that the service refused; they are not part of the volume.
    pub refused: Vec<RefusedInstance>,
    /// Files of the input that were not used (`triplanar reconstruct` alone), by name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unused: Vec<UnusedFile>,
    /// One row for each slice: axial, then sagittal, then coronal, each by index.
    pub slices: Vec<ReportRow>,
}

/// Where the volume came from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Identity {
    /// Study Instance UID (0020,000D).
    pub study_instance_uid: Option<StudyInstanceUid>,
    /// Series Instance UID (0020,000E).
    pub series_instance_uid: SeriesInstanceUid,
    /// Frame of Reference UID (0020,0052): the frame in which the cloud's coordinates are valid.
    pub frame_of_reference_uid: Option<FrameOfReferenceUid>,
}

/// Why there is no cloud.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct ReportError {
    /// Stable code.
    pub code: String,
    /// What went wrong and what to do next.
    pub detail: String,
}

/// Size and spacing of the volume in patient axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct VolumeSummary {
    /// Number of axial, coronal and sagittal slices: voxels along z, y, x.
    pub shape: [usize; 3],
    /// Length of one step along z, y, x in mm; the mean one along the axis of acquisition.
    pub step_mm: [f64; 3],
    /// The plane in which the scanner's own slices lie.
    pub acquired: Plane,
}

/// An instance of the series that was refused at receipt.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct RefusedInstance {
    /// The instance.
    pub sop_instance_uid: SopInstanceUid,
    /// Why, as in the problem's URN, e.g. `conflicting-instance`.
    pub code: String,
    /// How often it was sent.
    pub times: u64,
}

/// A file that is no instance of the series.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct UnusedFile {
    /// Its name, relative to the folder or zip.
    pub name: String,
    /// Why: `other-series`, or as in the problem's URN, e.g. `not-dicom`, `malformed-data-set`.
    pub code: String,
    /// The same in words.
    pub detail: String,
}

/// The decision on one slice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct ReportRow {
    /// The plane.
    pub plane: Plane,
    /// Index within the plane. Axial: 0 is the most superior slice; sagittal: 0 is the patient's
    /// rightmost; coronal: 0 is the most posterior.
    pub index: usize,
    /// Whether its contour, or any part of it, went into the cloud.
    pub accepted: bool,
    /// The test that it failed, or the reason of the longest of its rejected stretches; `null` for an
    /// accepted slice.
    pub reason: Option<Reason>,
    /// What that test measured, in the test's own unit (px, px², rows, a ratio, mm, HU).
    pub measured: Option<f64>,
    /// The limit that it was held against, in the same unit.
    pub limit: Option<f64>,
    /// Area of the contour, px²; `paper` alone, as the next one and the carried areas.
    pub contour_area: Option<f64>,
    /// Area of the contour / area of its convex hull.
    pub solidity: Option<f64>,
    /// Pixels of the contour (`paper`), or its crossings with the slice's grid lines (`precise`).
    pub contour_points: usize,
    /// The area carried from slice to slice before this one, px².
    pub carried_area_before: Option<f64>,
    /// The same after this slice, px².
    pub carried_area_after: Option<f64>,
    /// Where the slice's centre lies along the patient's axis, mm: LPS z for an axial slice, x
    /// for a sagittal one, y for a coronal one.
    pub position_mm: f64,
    /// The instance that the slice was acquired as: for the plane of acquisition if that is axial.
    pub sop_instance_uid: Option<SopInstanceUid>,
    /// `accepted`, `partly` or `rejected`.
    pub decision: Decision,
    /// Accepted contour, mm; `precise` alone.
    pub accepted_mm: Option<f64>,
    /// Rejected contour, mm: the sum of the stretches; `precise` alone.
    pub rejected_mm: Option<f64>,
    /// The stretches of the contour that were rejected; empty under `paper`.
    #[serde(default)]
    pub stretches: Vec<Stretch>,
}

impl Report {
    /// The report of a volume and what the pipeline found in it; quality, warnings, error and
    /// refused instances are for the caller to add.
    #[must_use]
    pub fn new(volume: &Volume, parameters: &Parameters, figures: &Figures, rows: &[SliceRow]) -> Self {
        let slices: Vec<_> = rows.iter().map(|row| ReportRow::new(row, volume)).collect();
        Self {
            software: crate::SOFTWARE.to_owned(),
            algorithm: Some(parameters.profile.algorithm().to_owned()),
            identity: Identity {
                study_instance_uid: volume.identity.study_instance_uid.clone(),
                series_instance_uid: volume.identity.series_instance_uid.clone(),
                frame_of_reference_uid: volume.identity.frame_of_reference_uid.clone(),
            },
            parameters: parameters.clone(),
            error: None,
            volume: VolumeSummary::new(&volume.grid),
            figures: figures.clone(),
            quality: None,
            planes: PlaneSummary::of(&slices),
            warnings: Vec::new(),
            refused: Vec::new(),
            unused: Vec::new(),
            slices,
        }
    }

    /// The report as JSON, indented, with a line break at the end.
    ///
    /// # Panics
    /// Never: every number in a report is finite or becomes `null`.
    #[must_use]
    pub fn to_json(&self) -> Vec<u8> {
        let mut out = serde_json::to_vec_pretty(self).expect("a report has string keys alone");
        out.push(b'\n');
        out
    }

    /// The CSV of no slice: its header line.
    #[must_use]
    pub fn csv_without_rows() -> Vec<u8> {
        super::table::csv(&[]).into_bytes()
    }

    /// The rows of the slices as CSV (RFC 4180) with a header line.
    #[must_use]
    pub fn to_csv(&self) -> Vec<u8> {
        super::table::csv(&self.slices).into_bytes()
    }
}

impl VolumeSummary {
    fn new(grid: &Grid) -> Self {
        Self {
            shape: grid.shape(),
            step_mm: grid.step().map(norm),
            acquired: match grid.slice_axis() {
                Axis::Z => Plane::Axial,
                Axis::Y => Plane::Coronal,
                Axis::X => Plane::Sagittal,
            },
        }
    }
}

impl ReportRow {
    fn new(row: &SliceRow, volume: &Volume) -> Self {
        let axial_instance = match row.plane {
            Plane::Axial => volume.axial_sop_instance_uid(row.index).cloned(),
            Plane::Sagittal | Plane::Coronal => None,
        };
        Self {
            plane: row.plane,
            index: row.index,
            accepted: row.rejection.is_none(),
            reason: row.rejection.map(|rejection| rejection.reason),
            measured: row.rejection.map(|rejection| rejection.measured),
            limit: row.rejection.map(|rejection| rejection.limit),
            contour_area: row.contour_area,
            solidity: row.solidity,
            contour_points: row.contour_points,
            carried_area_before: row.carried_area.0,
            carried_area_after: row.carried_area.1,
            position_mm: position(&volume.grid, row.plane, row.index),
            sop_instance_uid: axial_instance,
            decision: row.decision(),
            accepted_mm: row.accepted_mm,
            rejected_mm: row.accepted_mm.map(|_| row.stretches.iter().fold(0.0, |sum, s| sum + s.length_mm)),
            stretches: row.stretches.clone(),
        }
    }
}

/// LPS coordinate across the plane of the slice's centre: the mean of its two opposite corners.
fn position(grid: &Grid, plane: Plane, index: usize) -> f64 {
    let last = grid.shape().map(|n| n.saturating_sub(1));
    let array_axis = slices::axis(plane);
    let patient_axis = 2 - array_axis as usize;
    let (mut from, mut to) = ([0; 3], last);
    from[array_axis as usize] = index;
    to[array_axis as usize] = index;
    f64::midpoint(grid.lps(from)[patient_axis], grid.lps(to)[patient_axis])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tilted_slices_position_is_its_centres() {
        // Two slices of 3 × 3 pixels, rows rising by 0.5 mm a row.
        let step = [[0.0, 0.0, 0.0], [0.0, -1.0, 0.5], [1.0, 0.0, 0.0]];
        let grid = Grid::new(Axis::Z, vec![[0.0, 9.0, 20.0], [0.0, 9.0, 18.0]], step, [2, 3, 3]);
        assert_eq!(position(&grid, Plane::Axial, 1), 18.5);
        assert_eq!(position(&grid, Plane::Coronal, 2), 7.0);
        assert_eq!(position(&grid, Plane::Sagittal, 2), 2.0);
    }
}
