//! Which tissue is the patient: the body and what of the pieces on it is its own.
//!
//! What the ball that opens the body could not enter hangs on it in pieces: ears, nose and jaw are small; a
//! holder, a couch, straps and tubes are long.

use super::body::{Body, OwnTissue, clear_pieces};
use super::crop;
use super::devices::{cords, parts, sheets};
use super::field_border::FieldBorder;
use super::label::Label;
use super::outside::Open;
use super::slender::Slender;
use crate::geometry::{Vec3, scale};
use crate::pipeline::precise::grid::cells::Cells;
use crate::pipeline::precise::grid::reach::within;
use crate::pipeline::precise::scan::Scan;
use crate::pipeline::precise::scan::survey::Survey;

/// Edge of the survey's cells, mm; larger where the patient is.
const EDGE_MM: f64 = 1.0;

/// Steps in which clear tissue is looked for behind a border, mm.
const DEPTH_MM: f64 = 0.5;
/// How deep the edge of the skin itself reaches, mm.
pub(crate) const CLEAR_MM: f64 = 2.0;
/// How deep a layer on the skin reaches that is no clear tissue, such as a bandage, a gel or hair, mm.
const DEEPEST_MM: f64 = 20.0;

/// What is so near something foreign may touch it, mm.
const FOREIGN_MM: f64 = 3.5;

/// The patient in the survey's cells and in the scan's voxels.
#[derive(Debug)]
pub(crate) struct Patient {
    /// The survey.
    pub(crate) survey: Survey,
    /// What each of its cells holds.
    pub(crate) labels: Vec<Label>,
    /// Whether each is near one that holds something other than air and patient.
    pub(crate) near_foreign: Vec<bool>,
    /// Where the field of view ends.
    pub(crate) field_border: FieldBorder,
    tissue: OwnTissue,
}

impl Patient {
    /// Finds the patient; `None` if nothing in the scan is thick enough to be one.
    pub(crate) fn find(scan: &Scan<'_>) -> Option<Self> {
        let Scan { sampler, levels, field_of_view, .. } = scan;
        let pieces = clear_pieces(sampler, levels);
        sampler.ask();
        let survey = Survey::of(sampler, field_of_view, Cells::over(crop::bounds(scan), EDGE_MM));
        sampler.ask();
        let Body { mut labels, near, tissue } = Body::find(scan, &survey, pieces)?;
        sampler.ask();
        let field_border = FieldBorder::of(scan, &survey);
        sampler.ask();
        let (asked, cells) = (sampler.asked(), survey.cells);
        let open = Open::find(asked, &survey, &labels, &field_border);
        sampler.ask();
        let solid = |i: usize| labels[i] == Label::Patient || open.is_enclosed(i);
        if let Some((slender, opened)) = Slender::find(sampler, cells, cords::OUT_MM, solid) {
            cords::mark(asked, &slender, &opened, &mut labels);
        }
        sampler.ask();
        sheets::peel(sampler, levels, &cells, &mut labels, |i| open.is_open(i));
        sampler.ask();
        parts::judge(asked, &cells, &mut labels, &near, |i| open.is_open(i));
        sampler.ask();
        let foreign = |i: usize| matches!(labels[i], Label::Attached | Label::Other);
        let near_foreign = within(asked, cells.shape, cells.squared(FOREIGN_MM), foreign);
        Some(Self { survey, labels, near_foreign, field_border, tissue })
    }

    /// Whether something that is not the patient is close to a place.
    pub(crate) fn is_near_foreign(&self, place: Vec3) -> bool {
        let cells = &self.survey.cells;
        cells.at(place).is_some_and(|cell| self.near_foreign[cells.offset(cell)])
    }

    /// How far behind a border at `p` with the outward normal `n` the first clear tissue is that no
    /// air parts from it, mm, and whether it is the patient's own; `None` if there is none.
    pub(crate) fn clear_tissue(&self, scan: &Scan<'_>, p: Vec3, n: Vec3) -> Option<(f64, bool)> {
        let Scan { sampler, levels, .. } = scan;
        let steps = (DEEPEST_MM / DEPTH_MM) as usize;
        let inward = sampler.line(p, scale(n, -1.0));
        for d in (1..=steps).map(|step| step as f64 * DEPTH_MM) {
            let voxel = sampler.within(inward.index(d)).nearest();
            if let Some(own) = self.tissue.at(voxel) {
                return Some((d, own));
            }
            if d > CLEAR_MM && sampler.voxel(voxel) < levels.middle() {
                return None;
            }
        }
        None
    }
}
