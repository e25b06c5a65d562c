//! The decision on every slice of a volume.

use std::sync::atomic::{AtomicUsize, Ordering};

use ndarray::Array3;
use rayon::iter::{IntoParallelIterator, ParallelIterator};

use super::bitmap::Bitmap;
use super::contour::outline;
use super::mask;
use super::rules::{CarriedArea, Findings};
use crate::geometry::Plane;
use crate::observer::{Observer, Stage};
use crate::pipeline::parameters::Parameters;
use crate::pipeline::result::{PipelineError, Reason, Rejection, SliceRow};
use crate::pipeline::slices::{self, Pixel};

/// A row for every slice, and the contours of the accepted ones.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Decisions {
    /// Axial, then sagittal, then coronal, each by index.
    pub rows: Vec<SliceRow>,
    /// For each row the pixels of the contour; empty for a rejected slice.
    pub contours: Vec<Vec<Pixel>>,
    /// The same of the rejected slices: for pictures alone.
    pub rejected: Vec<Vec<Pixel>>,
}

impl Decisions {
    /// Index and contour of the accepted slices of a plane.
    pub fn accepted(&self, plane: Plane) -> impl Iterator<Item = (usize, &[Pixel])> {
        let rows = self.rows.iter().zip(&self.contours);
        rows.filter(move |(row, _)| row.plane == plane && row.rejection.is_none())
            .map(|(row, contour)| (row.index, contour.as_slice()))
    }
}

/// What one slice gives before its area is compared with the slices before it.
struct Candidate {
    findings: Findings,
    contour: Vec<Pixel>,
}

/// Decides on every slice of the volume `V[[z, y, x]]` (paper, sections 2.1 and 2.2).
///
/// The slices of a plane are looked at in parallel; the area carried from slice to slice is then
/// compared in their order.
///
/// # Errors
/// [`PipelineError::Cancelled`] if the observer asks for it.
pub fn decide(
    hu: &Array3<i16>,
    parameters: &Parameters,
    observer: &dyn Observer,
) -> Result<Decisions, PipelineError> {
    let mut decisions = Decisions::default();
    for (plane, stage) in Plane::ALL.into_iter().zip([Stage::Axial, Stage::Sagittal, Stage::Coronal]) {
        let mut carried = CarriedArea::default();
        let candidates = candidates(hu, plane, stage, parameters, observer)?;
        for (index, candidate) in candidates.into_iter().enumerate() {
            let (row, contour) = decide_slice(plane, index, candidate, &mut carried, parameters);
            let (accepted, rejected) =
                if row.rejection.is_none() { (contour, Vec::new()) } else { (Vec::new(), contour) };
            decisions.rows.push(row);
            decisions.contours.push(accepted);
            decisions.rejected.push(rejected);
        }
    }
    Ok(decisions)
}

fn candidates(
    hu: &Array3<i16>,
    plane: Plane,
    stage: Stage,
    parameters: &Parameters,
    observer: &dyn Observer,
) -> Result<Vec<Option<Candidate>>, PipelineError> {
    let (nz, ny, nx) = hu.dim();
    let count = slices::count([nz, ny, nx], plane);
    let block = mask::block(plane);
    let done = AtomicUsize::new(0);
    observer.progress(stage, 0.0);
    let blocks: Vec<Vec<Option<Candidate>>> = (0..count.div_ceil(block))
        .into_par_iter()
        .map(|number| {
            let indices = number * block..count.min((number + 1) * block);
            if observer.cancelled() {
                return Err(PipelineError::Cancelled);
            }
            let masks = mask::masks(hu, plane, indices, parameters).into_iter();
            masks
                .map(|mask| {
                    if observer.cancelled() {
                        return Err(PipelineError::Cancelled);
                    }
                    let candidate = candidate(mask, plane, parameters);
                    let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                    #[expect(clippy::cast_precision_loss, reason = "numbers of slices")]
                    observer.progress(stage, done as f64 / count as f64);
                    Ok(candidate)
                })
                .collect()
        })
        .collect::<Result<_, _>>()?;
    Ok(blocks.into_iter().flatten().collect())
}

fn candidate(mask: Bitmap, plane: Plane, parameters: &Parameters) -> Option<Candidate> {
    let outline = outline(mask, plane, &parameters.thresholds.contour)?;
    let findings = Findings::of(&outline, &parameters.thresholds);
    Some(Candidate { findings, contour: outline.contour.pixels })
}

fn decide_slice(
    plane: Plane,
    index: usize,
    candidate: Option<Candidate>,
    carried: &mut CarriedArea,
    parameters: &Parameters,
) -> (SliceRow, Vec<Pixel>) {
    let Some(Candidate { findings, contour }) = candidate else {
        let row = SliceRow {
            plane,
            index,
            rejection: Some(Rejection::count(Reason::NoContour, 0, 1)),
            contour_area: None,
            solidity: None,
            contour_points: 0,
            carried_area: (carried.0, carried.0),
            accepted_mm: None,
            stretches: Vec::new(),
        };
        return (row, Vec::new());
    };
    let before = carried.start(&findings.measures);
    let rejection = carried.decide(&findings, &parameters.thresholds);
    let row = SliceRow {
        plane,
        index,
        rejection,
        contour_area: Some(findings.measures.area),
        solidity: Some(findings.measures.solidity),
        contour_points: contour.len(),
        carried_area: (Some(before), carried.0),
        accepted_mm: None,
        stretches: Vec::new(),
    };
    (row, contour)
}
