//! Cavities that the border of the field of view lays open: their air meets it, but is none outside.

use rayon::prelude::*;

use super::label::Label;
use crate::observer::stop::Asked;
use crate::pipeline::precise::grid::cells::Cells;
use crate::pipeline::precise::grid::index::Voxel;
use crate::pipeline::precise::grid::reach::within;
use crate::pipeline::precise::scan::Scan;
use crate::pipeline::precise::scan::survey::Survey;

/// What is so near the border of the field of view meets it, in cells: a cell upon it holds a mixture.
const AT_BORDER: f64 = 2.0;
/// Where air meets the border so far from where it cuts the patient, it is outside; what joins it there,
/// too, mm.
const WIDE_MM: f64 = 15.0;
/// So far beyond the border nothing is asked, in cells.
const BEYOND: f64 = 3.0;

/// How a cell lies to the border of the field of view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum At {
    Elsewhere,
    /// At the border, where the last voxels hold no tissue.
    Border,
    /// At the border, where the last voxels hold tissue.
    Tissue,
}

/// Where the border of the field of view runs through tissue.
#[derive(Debug)]
pub(crate) struct FieldBorder(Vec<At>);

impl FieldBorder {
    /// Looks at the last voxels before the border: skin right next to it, even a voxel away, shows air
    /// there.
    pub(crate) fn of(scan: &Scan<'_>, survey: &Survey) -> Self {
        let sampler = &scan.sampler;
        let (cells, aside) = (&survey.cells, &survey.aside);
        if !aside.par_iter().any(|a| *a) {
            return Self(Vec::new());
        }
        let near = within(sampler.asked(), cells.shape, squared(AT_BORDER), |i| aside[i]);
        let at = |i: usize| {
            sampler.ask_at(i);
            match near[i] && !aside[i] {
                false => At::Elsewhere,
                true if ends_in_tissue(scan, cells, i) => At::Tissue,
                true => At::Border,
            }
        };
        Self((0..cells.len()).into_par_iter().panic_fuse().map(at).collect())
    }

    /// The cells that shut the openings in the patient where the border cuts it: where air between
    /// cut tissue is narrower there than twice [`WIDE_MM`]. Empty if nothing is cut.
    pub(crate) fn laid_open(&self, asked: Asked<'_>, survey: &Survey, labels: &[Label]) -> Vec<bool> {
        let (Self(at), cells) = (self, &survey.cells);
        let cut = |i: usize| at[i] == At::Tissue && labels[i] == Label::Patient;
        if !(0..at.len()).into_par_iter().any(cut) {
            return Vec::new();
        }
        let border = |i: usize| at[i] != At::Elsewhere;
        let wide = cells.squared(WIDE_MM);
        let near_cut = within(asked, cells.shape, wide, cut);
        let near_wide = within(asked, cells.shape, wide, |i| border(i) && !near_cut[i]);
        let narrow = |i: usize| border(i) && labels[i] != Label::Patient && !near_wide[i];
        let near_narrow = within(asked, cells.shape, squared(BEYOND), narrow);
        let shuts = |i: usize| narrow(i) || (survey.aside[i] && near_narrow[i]);
        (0..cells.len()).into_par_iter().map(shuts).collect()
    }
}

/// Whether a voxel in a cell or next to it is the last one before the border and holds tissue.
fn ends_in_tissue(scan: &Scan<'_>, cells: &Cells, cell: usize) -> bool {
    let Scan { sampler, levels, field_of_view, .. } = scan;
    let middle = sampler.clamped(cells.centre(cells.cell(cell))).nearest();
    let range = |a: usize| middle[a].saturating_sub(1)..(middle[a] + 2).min(sampler.shape[a]);
    let is_last = |v: Voxel| {
        field_of_view.distance(v) == Some(1)
            || [1, 2].into_iter().any(|a| v[a] == 0 || v[a] + 1 == sampler.shape[a])
    };
    range(1).any(|y| {
        range(2).any(|x| {
            let voxel = Voxel([middle[0], y, x]);
            is_last(voxel) && sampler.voxel(voxel) >= levels.middle()
        })
    })
}

fn squared(reach: f64) -> u16 {
    (reach * reach).floor() as u16
}
