//! What is larger than any thin part of a head: sheets, holders, tubes.

use super::pieces::Pieces;
use super::reach::within;
use super::survey::Cells;

/// Ears, nose and jaw are smaller: diagonal of the box, mm.
pub(super) const LARGEST_PART_MM: f64 = 95.0;
/// What lies nearer to each other than twice this belongs together, mm.
const LINK_MM: f64 = 4.0;

/// Which of some cells belong to something larger than any thin part of a head.
pub(super) fn are_large(cells: &Cells, some: &[usize]) -> Vec<bool> {
    if some.is_empty() {
        return Vec::new();
    }
    let mut marked = vec![false; cells.len()];
    some.iter().for_each(|&i| marked[i] = true);
    let near = within(cells.shape, cells.squared(LINK_MM), |i| marked[i]);
    drop(marked);
    let parts = Pieces::of(cells.shape, |i| near[i]);
    let mut boxes = vec![Bounds::default(); parts.sizes().len()];
    let part_of = |i: usize| {
        let [x, y, z] = cells.cell(i);
        parts.at(z, y, x).map(|part| part as usize)
    };
    let of: Vec<Option<usize>> = some.iter().map(|&i| part_of(i)).collect();
    for (&i, part) in some.iter().zip(&of) {
        if let Some(part) = *part {
            boxes[part].add(cells.cell(i));
        }
    }
    let is_large =
        |part: &Option<usize>| part.is_some_and(|part| boxes[part].diagonal() * cells.edge > LARGEST_PART_MM);
    of.iter().map(is_large).collect()
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
        for a in 0..3 {
            self.low[a] = self.low[a].min(cell[a]);
            self.high[a] = self.high[a].max(cell[a]);
        }
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
        let large = are_large(&cells, &all);
        assert!(large.iter().enumerate().all(|(i, large)| *large == (i < tube.len())), "{large:?}");
    }
}
