//! What stands on the head as slender as a cord: there is tissue, but a ball does not enter it.
//!
//! Cords, leads, tubes and the ribs of a mask are slender, and of a head the rims of the ears, the
//! wings of the nose, the lips. No ledge of theirs surrounds anything that is covered: a cord around a
//! face leaves the face as it is. What is slender and long, or slender and larger than anything slender
//! on a head, is a cord.

use rayon::prelude::*;

use super::label::BALL_MM;
use crate::geometry::{Vec3, add, eigenvalues, scale, sub};
use crate::observer::stop::Asked;
use crate::pipeline::precise::grid::cells::Cells;
use crate::pipeline::precise::grid::index::Cell;
use crate::pipeline::precise::grid::pieces::Pieces;
use crate::pipeline::precise::grid::reach::within;
use crate::pipeline::precise::rules::covered::surface::Surface;
use crate::pipeline::precise::scan::sampler::Sampler;

/// What stands higher over what the ball leaves is slender, mm: as part of a cord
/// (measured by `tools/skin_model/slender.py`, FINDINGS.md: of the points on the cords of a real head 0.96 lie
/// within 3.5 mm of it, of its skin 0.014),
pub(crate) const OF_CORD_MM: f64 = 0.6;
/// and as what surrounds nothing (the same: 0.72 and 0.006).
pub(crate) const OF_LEDGE_MM: f64 = 0.9;
/// The ball leaves out (√2 − 1) · 5 = 2.07 mm of the edge of anything thick, as pads and masks have it, of which
/// cells show less than this from centre to centre; of a cord of 3 mm they show 2, mm.
const HIGHER_THAN_EDGES_MM: f64 = 1.6;
/// Least share of what is slender that is higher.
/// Measured by `cargo test precise_phantoms::on_the_skin`: without it the edge of a pad counts as slender.
const HIGH: f64 = 0.1;
/// How far behind the border the cells are asked, mm.
const BEHIND_MM: f64 = 0.5;

/// A cord is longer than this, mm,
const CORD_MM: f64 = 30.0;
/// and its standard deviation along its second axis no more than this share of that along its first.
/// Measured by `tools/skin_model/slender.py` (FINDINGS.md): cords 0.05 to 0.17, rims of ears 0.24 to 0.7.
const CORD_WIDTH: f64 = 0.2;
/// Nothing slender of a head is larger, mm: of ears with lobes the largest is 80 (the same).
const LARGEST_OWN_MM: f64 = 110.0;
/// A cord's foot reaches so far beside what of it stands out, mm,
const FOOT_MM: f64 = 2.5;
/// and the ledge of something slender so many links, of up to 2.4 leaves.
const FOOT: usize = 1;
/// Of a cord no more than so much lies, mm³,
const CORD_MM3: f64 = 400.0;
/// within so many mm. Measured by the same: 110 of a cord of 3 mm, 60 to 350 of those on two real heads; half of
/// what is slender of ears and noses has more than 500 around it.
const AROUND_MM: f64 = 10.0;
/// Steps between slices further apart look like cords, mm.
/// Measured on `ge_hispeed_tilt_variable`, with slices of 4 and 7 mm (FINDINGS.md).
const WIDEST_GAP_MM: f64 = 3.5;
/// What is slender and larger than fiducials and electrodes surrounds nothing, mm.
const LARGER_THAN_DISCS_MM: f64 = 40.0;

/// Which cells are further from what the ball leaves than the head's skin is.
#[derive(Debug)]
pub(crate) struct Slender {
    cells: Cells,
    far: Vec<bool>,
    /// The same, of what is higher than edges.
    high: Vec<bool>,
    /// Cells that the ball enters.
    opened: Vec<bool>,
    /// Whether it was looked for.
    any: bool,
}

impl Slender {
    /// What stands `mm` out of what is `solid`: the body, what hangs on it, and the air that it encloses.
    pub(crate) fn find(
        sampler: &Sampler<'_>,
        cells: Cells,
        mm: f64,
        solid: impl Fn(usize) -> bool + Sync,
    ) -> Self {
        if sampler.gaps().into_iter().any(|gap| gap > WIDEST_GAP_MM) {
            return Self { cells, far: Vec::new(), high: Vec::new(), opened: Vec::new(), any: false };
        }
        Self::in_cells(sampler.asked(), cells, mm, solid)
    }

    fn in_cells(asked: Asked<'_>, cells: Cells, mm: f64, solid: impl Fn(usize) -> bool + Sync) -> Self {
        let at_border = within(asked, cells.shape, cells.squared(BALL_MM), |i| !solid(i));
        let inner = Pieces::of(asked, cells.shape, |i| !at_border[i]);
        drop(at_border);
        let mut core = vec![false; cells.len()];
        if let Some(main) = inner.largest() {
            inner.each_row(|[y, z], run| {
                if run.piece == main {
                    let row = cells.offset(Cell([0, y, z]));
                    core[row + run.start as usize..row + run.end as usize].fill(true);
                }
            });
        }
        let beyond = |mm: f64| {
            let mut far = within(asked, cells.shape, cells.squared(BALL_MM + mm), |i| core[i]);
            far.iter_mut().for_each(|far| *far = !*far);
            far
        };
        let (far, high) = (beyond(mm), beyond(HIGHER_THAN_EDGES_MM));
        let opened = within(asked, cells.shape, cells.squared(BALL_MM), |i| core[i]);
        Self { cells, far, high, opened, any: true }
    }

    /// The cells of cords among those that are the patient's, with their feet.
    pub(crate) fn cords(&self, asked: Asked<'_>, is_patient: impl Fn(usize) -> bool + Sync) -> Vec<usize> {
        if !self.any {
            return Vec::new();
        }
        let cells = &self.cells;
        let is_slender = |i: usize| self.far[i] && is_patient(i);
        let pieces = Pieces::of(asked, cells.shape, is_slender);
        let (mut thread, mut any) = (vec![false; cells.len()], false);
        for of_piece in each_piece(cells, &pieces) {
            if extent(cells, &of_piece) > CORD_MM {
                let is_thread = |&i: &usize| {
                    asked.ask();
                    around(cells, i, AROUND_MM).filter(|&j| is_slender(j)).count() as f64 * cells.edge.powi(3)
                        < CORD_MM3
                };
                let of_thread: Vec<bool> = of_piece.par_iter().panic_fuse().map(is_thread).collect();
                any = true;
                of_piece.iter().zip(of_thread).for_each(|(&i, is)| thread[i] = is);
            }
        }
        if !any {
            return Vec::new();
        }
        let pieces = Pieces::of(asked, cells.shape, |i| thread[i]);
        let mut cord = vec![false; cells.len()];
        let mut found = false;
        for of_piece in each_piece(cells, &pieces) {
            let long = extent(cells, &of_piece);
            let places = || of_piece.iter().map(|&i| cells.centre(cells.cell(i)));
            let high = of_piece.iter().filter(|&&i| self.high[i]).count();
            if high as f64 > HIGH * of_piece.len() as f64
                && (long > LARGEST_OWN_MM || long > CORD_MM && is_rod(places))
            {
                found = true;
                of_piece.iter().for_each(|&i| cord[i] = true);
            }
        }
        if !found {
            return Vec::new();
        }
        let foot = within(asked, cells.shape, cells.squared(FOOT_MM), |i| cord[i]);
        (0..cells.len()).filter(|&i| foot[i] && !self.opened[i] && is_patient(i)).collect()
    }

    /// Whether the border at a place is one of something slender: most of the cells around the place
    /// just behind it are, by their trilinear share.
    fn holds(&self, far: &[bool], place: Vec3, normal: Vec3) -> bool {
        let behind = add(place, scale(normal, -BEHIND_MM));
        let at: Vec3 = std::array::from_fn(|a| (behind[a] - self.cells.origin[a]) / self.cells.edge);
        let low = at.map(f64::floor);
        let share: f64 = (0..8)
            .filter_map(|corner| {
                let step: [f64; 3] = std::array::from_fn(|a| f64::from(corner >> a & 1));
                let weight: f64 = (0..3).map(|a| 1.0 - (at[a] - low[a] - step[a]).abs()).product();
                let centre =
                    std::array::from_fn(|a| self.cells.origin[a] + (low[a] + step[a]) * self.cells.edge);
                let cell = self.cells.at(centre)?;
                far[self.cells.offset(cell)].then_some(weight)
            })
            .sum();
        share > 0.5
    }

    /// The links of what is slender on a surface, and beside it, are no ledges any more.
    pub(crate) fn level(&self, surface: &mut Surface) {
        if !self.any {
            return;
        }
        let holds = |far: &[bool]| -> Vec<bool> {
            let holds = |node: usize| {
                surface.asked.ask_at(node);
                self.holds(far, surface.places[node], surface.normals[node].map(f64::from))
            };
            (0..surface.len()).into_par_iter().panic_fuse().map(holds).collect()
        };
        let (slender, high) = (holds(&self.far), holds(&self.high));
        let (_, pieces) = surface.parts(|node| slender[node], |_, _| true);
        let larger = pieces.into_iter().filter(|nodes| {
            let high = nodes.iter().filter(|&&node| high[node]).count();
            high as f64 > HIGH * nodes.len() as f64 && surface.extent(nodes) > LARGER_THAN_DISCS_MM
        });
        surface.level_at(&surface.beyond(larger.flatten().collect(), FOOT));
    }
}

/// Whether places spread along one axis far more than along any other.
fn is_rod<I: Iterator<Item = Vec3>>(places: impl Fn() -> I) -> bool {
    let (count, sum) = places().fold((0.0, [0.0; 3]), |(count, sum), p| (count + 1.0, add(sum, p)));
    let middle = scale(sum, 1.0 / count);
    let mut spread = [[0.0; 3]; 3];
    for p in places() {
        let d = sub(p, middle);
        for (a, row) in spread.iter_mut().enumerate() {
            for (b, v) in row.iter_mut().enumerate() {
                *v += d[a] * d[b] / count;
            }
        }
    }
    let [_, width, length] = eigenvalues(spread).map(|v| v.max(0.0).sqrt());
    width < CORD_WIDTH * length
}

/// The cells of each piece.
fn each_piece(cells: &Cells, pieces: &Pieces) -> Vec<Vec<usize>> {
    let mut found = vec![Vec::new(); pieces.sizes().len()];
    pieces.each_row(|[y, z], run| {
        let row = cells.offset(Cell([0, y, z]));
        found[run.piece as usize].extend(row + run.start as usize..row + run.end as usize);
    });
    found
}

/// Diagonal of the box around some cells, mm.
fn extent(cells: &Cells, of: &[usize]) -> f64 {
    let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
    for at in of.iter().map(|&i| cells.cell(i)) {
        for a in 0..3 {
            low[a] = low[a].min(at[a]);
            high[a] = high[a].max(at[a]);
        }
    }
    let squares = (0..3).map(|a| ((high[a].saturating_sub(low[a])) as f64).powi(2));
    squares.sum::<f64>().sqrt() * cells.edge
}

/// The cells in a ball around one.
fn around(cells: &Cells, cell: usize, mm: f64) -> impl Iterator<Item = usize> {
    let reach = (mm / cells.edge) as usize;
    let at = cells.cell(cell);
    cells
        .block(at, reach)
        .filter(move |to| {
            let squared: usize = (0..3).map(|a| to[a].abs_diff(at[a]).pow(2)).sum();
            squared <= reach * reach
        })
        .map(|to| cells.offset(to))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::precise::grid::cells::each_cell;

    /// A block whose face is at z = 40, with a cord, an ear and a thick pad on it.
    #[test]
    fn cords_are_found_and_ears_and_the_edges_of_pads_are_not() {
        let cells = Cells { origin: [0.0; 3], edge: 1.0, shape: [140, 140, 75] };
        let is_in = |v: usize, from: usize, size: usize| (from..from + size).contains(&v);
        let cord = |[x, y, z]: [usize; 3]| is_in(z, 40, 4) && is_in(x, 20, 4) && is_in(y, 10, 90);
        let ear = |[x, y, z]: [usize; 3]| is_in(x, 100, 4) && is_in(y, 20, 60) && is_in(z, 40, 28);
        let pad = |[x, y, z]: [usize; 3]| is_in(x, 70, 50) && is_in(y, 95, 35) && is_in(z, 40, 12);
        let is_solid = |i: usize| {
            let at = cells.cell(i).0;
            is_in(at[2], 8, 32) || cord(at) || ear(at) || pad(at)
        };
        let slender = Slender::in_cells(Asked::default(), cells, OF_CORD_MM, is_solid);
        let mut found = vec![false; cells.len()];
        slender.cords(Asked::default(), is_solid).into_iter().for_each(|i| found[i] = true);
        let (mut marked, mut all, mut wrong) = (0, 0, 0);
        each_cell(&cells, |i, at| {
            all += usize::from(cord(at.0));
            marked += usize::from(cord(at.0) && found[i]);
            wrong += usize::from(!cord(at.0) && found[i]);
        });
        // Its lowest layer is so flat that the ball reaches it.
        assert_eq!((marked, all), (3 * 4 * 90, 4 * 4 * 90));
        assert_eq!(wrong, 0);
    }
}
