//! What is larger than any thin part of a head: sheets, holders, tubes.

use rayon::prelude::*;

use crate::observer::stop::Asked;
use crate::pipeline::precise::grid::cells::Cells;
use crate::pipeline::precise::grid::index::Cell;
use crate::pipeline::precise::grid::pieces::Pieces;
use crate::pipeline::precise::grid::reach::within;

/// Ears, nose and jaw are smaller: diagonal of the box, mm.
pub(crate) const LARGEST_PART_MM: f64 = 95.0;
/// Neither are a nose and the wall of a frontal sinus together longer than this, mm.
const LARGEST_FACE_MM: f64 = 150.0;
/// What lies nearer to each other than twice this belongs together, mm.
const LINK_MM: f64 = 4.0;

/// Which of some cells belong to something larger than any thin part of a head; where less than half of
/// its cells stand `free`, to something larger than a face.
pub(crate) fn are_large(
    asked: Asked<'_>,
    cells: &Cells,
    some: &[usize],
    free: impl Fn(usize) -> bool + Sync,
) -> Vec<bool> {
    if some.is_empty() {
        return Vec::new();
    }
    let mut marked = vec![false; cells.len()];
    some.iter().for_each(|&i| marked[i] = true);
    let near = within(asked, cells.shape, cells.squared(LINK_MM), |i| marked[i]);
    drop(marked);
    let parts = Pieces::of(asked, cells.shape, |i| near[i]);
    let part_of = |i: usize| {
        let Cell([x, y, z]) = cells.cell(i);
        parts.at(z, y, x).map(|part| part as usize)
    };
    let free = some.par_iter().enumerate().panic_fuse().map(|(n, &i)| {
        asked.ask_at(n);
        free(i)
    });
    let free = free.collect::<Vec<_>>();
    let mut found = vec![(Bounds::default(), 0, 0); parts.sizes().len()];
    for (n, (&i, free)) in some.iter().zip(free).enumerate() {
        asked.ask_at(n);
        if let Some(part) = part_of(i) {
            let (bounds, all, all_free) = &mut found[part];
            bounds.add(cells.cell(i));
            *all += 1;
            *all_free += usize::from(free);
        }
    }
    let is_large = |part: usize| {
        let (bounds, all, all_free) = &found[part];
        let largest = if 2 * all_free >= *all { LARGEST_PART_MM } else { LARGEST_FACE_MM };
        bounds.diagonal() * cells.edge > largest
    };
    some.iter().map(|&i| part_of(i).is_some_and(is_large)).collect()
}

/// The box around some cells.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    low: [usize; 3],
    high: [usize; 3],
}

impl Default for Bounds {
    fn default() -> Self {
        Self { low: [usize::MAX; 3], high: [0; 3] }
    }
}

impl Bounds {
    /// Takes a cell in.
    pub(crate) fn add(&mut self, cell: Cell) {
        self.low = std::array::from_fn(|a| self.low[a].min(cell[a]));
        self.high = std::array::from_fn(|a| self.high[a].max(cell[a]));
    }

    /// Of the box, in cells; of a single cell's that of a cube.
    pub(crate) fn diagonal(&self) -> f64 {
        let square = |a: usize| ((self.high[a] + 1).saturating_sub(self.low[a]) as f64).powi(2);
        (0..3).map(square).sum::<f64>().sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tube of 100 mm with a gap in its middle, and a nose.
    #[test]
    fn parts_with_a_narrow_gap_are_one_and_a_nose_is_small() {
        let cells = Cells { origin: [0.0; 3], edge: 1.0, shape: [120, 80, 60] };
        let tube: Vec<usize> =
            (5..105).filter(|x| !(50..56).contains(x)).map(|x| cells.offset(Cell([x, 5, 5]))).collect();
        let nose: Vec<usize> = (0..35).map(|i| cells.offset(Cell([40 + i / 2, 30 + i, 20 + i]))).collect();
        let all = [tube.clone(), nose].concat();
        let large = are_large(Asked::default(), &cells, &all, |_| true);
        assert!(large.iter().enumerate().all(|(i, large)| *large == (i < tube.len())), "{large:?}");
        let own = are_large(Asked::default(), &cells, &all, |i| cells.cell(i)[0] < 45);
        assert!(!own.contains(&true), "as small as a face");
    }
}
