//! What is larger than any thin part of a head: sheets, holders, tubes.

use rayon::prelude::*;

use super::pieces::Pieces;
use super::reach::within;
use super::survey::Cells;

/// Ears, nose and jaw are smaller: diagonal of the box, mm.
pub(super) const LARGEST_PART_MM: f64 = 95.0;
/// What lies nearer to each other than twice this belongs together, mm.
const LINK_MM: f64 = 4.0;

/// Which of some cells belong to something larger than any thin part of a head, at least half of whose
/// cells are `foreign`.
pub(super) fn are_large(cells: &Cells, some: &[usize], foreign: impl Fn(usize) -> bool + Sync) -> Vec<bool> {
    if some.is_empty() {
        return Vec::new();
    }
    let mut marked = vec![false; cells.len()];
    some.iter().for_each(|&i| marked[i] = true);
    let near = within(cells.shape, cells.squared(LINK_MM), |i| marked[i]);
    drop(marked);
    let parts = Pieces::of(cells.shape, |i| near[i]);
    let part_of = |i: usize| {
        let [x, y, z] = cells.cell(i);
        parts.at(z, y, x).map(|part| part as usize)
    };
    let foreign = some.par_iter().map(|&i| foreign(i)).collect::<Vec<_>>();
    let mut found = vec![(Bounds::default(), 0, 0); parts.sizes().len()];
    for (&i, foreign) in some.iter().zip(foreign) {
        if let Some(part) = part_of(i) {
            let (bounds, all, foreigners) = &mut found[part];
            bounds.add(cells.cell(i));
            *all += 1;
            *foreigners += usize::from(foreign);
        }
    }
    let is_large = |part: usize| {
        let (bounds, all, foreigners) = &found[part];
        bounds.diagonal() * cells.edge > LARGEST_PART_MM && 2 * foreigners >= *all
    };
    some.iter().map(|&i| part_of(i).is_some_and(is_large)).collect()
}

/// The box around some cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds {
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
    pub(super) fn add(&mut self, cell: [usize; 3]) {
        self.low = std::array::from_fn(|a| self.low[a].min(cell[a]));
        self.high = std::array::from_fn(|a| self.high[a].max(cell[a]));
    }

    /// Of the box, in cells; of a single cell's that of a cube.
    pub(super) fn diagonal(&self) -> f64 {
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
            (5..105).filter(|x| !(50..56).contains(x)).map(|x| cells.offset([x, 5, 5])).collect();
        let nose: Vec<usize> = (0..35).map(|i| cells.offset([40 + i / 2, 30 + i, 20 + i])).collect();
        let all = [tube.clone(), nose].concat();
        let large = are_large(&cells, &all, |_| true);
        assert!(large.iter().enumerate().all(|(i, large)| *large == (i < tube.len())), "{large:?}");
        let own = are_large(&cells, &all, |i| cells.cell(i)[0] < 45);
        assert!(!own.contains(&true), "too little of it is foreign");
    }
}
