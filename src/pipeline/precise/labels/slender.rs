//! What stands on the head as slender as a cord: there is tissue, but a ball does not enter it.
//!
//! Cords, leads, tubes and the ribs of a mask are slender, and of a head the rims of the ears, the wings of the
//! nose, the lips.

use super::label::BALL_MM;
use crate::geometry::{Vec3, add, scale};
use crate::observer::stop::Asked;
use crate::pipeline::precise::grid::cells::Cells;
use crate::pipeline::precise::grid::index::Cell;
use crate::pipeline::precise::grid::pieces::Pieces;
use crate::pipeline::precise::grid::reach::within;
use crate::pipeline::precise::scan::sampler::Sampler;

/// The ball leaves out (√2 − 1) · 5 = 2.07 mm of the edge of anything thick, as pads and masks have it, of which
/// cells show less than this from centre to centre; of a cord of 3 mm they show 2, mm.
const HIGHER_THAN_EDGES_MM: f64 = 1.6;
/// Least share of something slender that is higher.
/// Measured by `cargo test precise_phantoms::on_the_skin`: without it the edge of a pad counts as slender.
const HIGH: f64 = 0.1;
/// How far behind the border the cells are asked, mm.
const BEHIND_MM: f64 = 0.5;
/// Steps between slices further apart look like cords, mm.
/// Measured on `ge_hispeed_tilt_variable`, with slices of 4 and 7 mm (FINDINGS.md).
const WIDEST_GAP_MM: f64 = 3.5;

/// Which cells stand out of what the ball leaves.
#[derive(Debug)]
pub(crate) struct Slender {
    cells: Cells,
    out: Vec<bool>,
    /// The same, of what is higher than edges.
    high: Vec<bool>,
}

impl Slender {
    /// What stands `mm` out of what is `solid` (the body, what hangs on it, and the air that it encloses), and the
    /// cells that the ball enters; `None` where slices lie too far apart to show it.
    pub(crate) fn find(
        sampler: &Sampler<'_>,
        cells: Cells,
        mm: f64,
        solid: impl Fn(usize) -> bool + Sync,
    ) -> Option<(Self, Vec<bool>)> {
        let is_shown = sampler.gaps().into_iter().all(|gap| gap <= WIDEST_GAP_MM);
        is_shown.then(|| Self::in_cells(sampler.asked(), cells, mm, solid))
    }

    pub(crate) fn in_cells(
        asked: Asked<'_>,
        cells: Cells,
        mm: f64,
        solid: impl Fn(usize) -> bool + Sync,
    ) -> (Self, Vec<bool>) {
        let core = core(asked, &cells, solid);
        let opened = |mm: f64| within(asked, cells.shape, cells.squared(BALL_MM + mm), |i| core[i]);
        let beyond = |mm: f64| {
            let mut out = opened(mm);
            out.iter_mut().for_each(|out| *out = !*out);
            asked.ask();
            out
        };
        (Self { cells, out: beyond(mm), high: beyond(HIGHER_THAN_EDGES_MM) }, opened(0.0))
    }

    /// The cells in which it was looked for.
    pub(crate) fn cells(&self) -> &Cells {
        &self.cells
    }

    /// Whether a cell, if it is solid, stands out.
    pub(crate) fn is_out(&self, cell: usize) -> bool {
        self.out[cell]
    }

    /// Whether enough of some cells that stand out is higher than edges.
    pub(crate) fn are_high(&self, some: &[usize]) -> bool {
        is_enough(some.iter().filter(|&&i| self.high[i]).count(), some.len())
    }

    /// Whether the border at a place, with the outward `normal`, stands out, and whether it is higher than
    /// edges.
    pub(crate) fn at_border(&self, place: Vec3, normal: Vec3) -> [bool; 2] {
        [&self.out, &self.high].map(|marked| self.holds(marked, place, normal))
    }

    /// Whether most of the cells around the place just behind a border are marked, by their trilinear share.
    fn holds(&self, marked: &[bool], place: Vec3, normal: Vec3) -> bool {
        let behind = add(place, scale(normal, -BEHIND_MM));
        let at: Vec3 = std::array::from_fn(|a| (behind[a] - self.cells.origin[a]) / self.cells.edge);
        let low = at.map(f64::floor);
        let share: f64 = (0..8)
            .filter_map(|corner| {
                let step: Vec3 = std::array::from_fn(|a| f64::from(corner >> a & 1));
                let weight: f64 = (0..3).map(|a| 1.0 - (at[a] - low[a] - step[a]).abs()).product();
                let centre =
                    std::array::from_fn(|a| self.cells.origin[a] + (low[a] + step[a]) * self.cells.edge);
                let cell = self.cells.at(centre)?;
                marked[self.cells.offset(cell)].then_some(weight)
            })
            .sum();
        share > 0.5
    }
}

/// Whether so many of all are higher than edges.
pub(crate) fn is_enough(high: usize, all: usize) -> bool {
    high as f64 > HIGH * all as f64
}

/// The centres of the ball in the largest piece that lets it pass.
fn core(asked: Asked<'_>, cells: &Cells, solid: impl Fn(usize) -> bool + Sync) -> Vec<bool> {
    let at_border = within(asked, cells.shape, cells.squared(BALL_MM), |i| !solid(i));
    let inner = Pieces::of(asked, cells.shape, |i| !at_border[i]);
    let mut core = vec![false; cells.len()];
    let main = inner.largest();
    inner.each_row(|[y, z], run| {
        asked.ask_at(y);
        if Some(run.piece) == main {
            let row = cells.offset(Cell([0, y, z]));
            core[row + run.start as usize..row + run.end as usize].fill(true);
        }
    });
    core
}
