//! Cavities that the border of the field of view lays open: their air meets it, but is none outside.

use rayon::prelude::*;

use super::distance::squared_distance;
use super::kinds::Cell;
use super::survey::Survey;

/// What is so near the border of the field of view meets it, in cells: a cell upon it holds a mixture.
const AT_BORDER: f64 = 2.0;
/// Where air meets the border so far from the patient, it is outside; what joins it there, too, mm.
const WIDE_MM: f64 = 15.0;
/// So far beyond the border nothing is asked, in cells.
const BEYOND: f64 = 3.0;

/// The cells that shut the openings in the patient where the border of the field of view cuts it:
/// where air between cut tissue is narrower there than twice [`WIDE_MM`]. Empty if nothing is cut.
pub(super) fn laid_open(survey: &Survey, kinds: &[Cell]) -> Vec<bool> {
    let (cells, aside) = (&survey.cells, &survey.aside);
    let squared = |reach: f64| (reach * reach).floor() as u16;
    if !aside.par_iter().any(|a| *a) {
        return Vec::new();
    }
    let near = squared_distance(cells.shape, squared(AT_BORDER), |i| aside[i]);
    let border = |i: usize| near[i] != u16::MAX && !aside[i];
    let cut = |i: usize| border(i) && kinds[i] == Cell::Patient;
    if !(0..cells.len()).into_par_iter().any(cut) {
        return Vec::new();
    }
    let wide = cells.squared(WIDE_MM);
    let from_cut = squared_distance(cells.shape, wide, cut);
    let from_wide = squared_distance(cells.shape, wide, |i| border(i) && from_cut[i] == u16::MAX);
    let narrow = |i: usize| border(i) && kinds[i] != Cell::Patient && from_wide[i] == u16::MAX;
    let beyond = squared_distance(cells.shape, squared(BEYOND), narrow);
    (0..cells.len()).into_par_iter().map(|i| narrow(i) || (aside[i] && beyond[i] != u16::MAX)).collect()
}
