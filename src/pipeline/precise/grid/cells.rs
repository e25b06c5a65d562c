//! Cubic cells along the patient's axes: where each is, and which lie beside each other.

use super::index::Cell;
use crate::geometry::Vec3;

/// Cubic cells along LPS; index `(z · ny + y) · nx + x`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cells {
    /// LPS mm of the centre of cell 0.
    pub(crate) origin: Vec3,
    /// Edge, mm.
    pub(crate) edge: f64,
    /// `[nx, ny, nz]`.
    pub(crate) shape: [usize; 3],
}

/// At most so many cells: the memory and the time that the search may take.
const MOST_CELLS: f64 = 20e6;
impl Cells {
    /// Cells of at least that edge (mm) over a box in LPS mm, larger ones if those would be too many.
    pub(crate) fn over(bounds: [Vec3; 2], least_edge: f64) -> Self {
        let edge = (extent(bounds).iter().product::<f64>() / MOST_CELLS).cbrt().max(least_edge);
        let shape = extent(bounds).map(|e| (e.max(0.0) / edge).floor() as usize + 1);
        Self { origin: bounds[0], edge, shape }
    }

    /// Number of cells.
    pub(crate) fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// The cell that holds a place, if it is in the survey.
    #[inline]
    pub(crate) fn at(&self, p: Vec3) -> Option<Cell> {
        let mut cell = [0; 3];
        for a in 0..3 {
            let v = (p[a] - self.origin[a]) / self.edge + 0.5;
            cell[a] = v as usize;
            if !(v >= 0.0 && cell[a] < self.shape[a]) {
                return None;
            }
        }
        Some(Cell(cell))
    }

    /// Offset of a cell.
    #[inline]
    pub(crate) fn offset(&self, Cell([x, y, z]): Cell) -> usize {
        (z * self.shape[1] + y) * self.shape[0] + x
    }

    /// The cell at an offset.
    #[inline]
    pub(crate) fn cell(&self, offset: usize) -> Cell {
        let [nx, ny, _] = self.shape;
        Cell([offset % nx, offset / nx % ny, offset / (nx * ny)])
    }

    /// The cells no more than `reach` away along each axis, those outside the survey left out.
    pub(crate) fn block(&self, cell: Cell, reach: usize) -> impl Iterator<Item = Cell> {
        let range = |a: usize| cell[a].saturating_sub(reach)..(cell[a] + reach + 1).min(self.shape[a]);
        let (xs, ys) = (range(0), range(1));
        range(2).flat_map(move |z| {
            let xs = xs.clone();
            ys.clone().flat_map(move |y| xs.clone().map(move |x| Cell([x, y, z])))
        })
    }

    /// The up to 26 cells around one, with how many axes apart they are.
    pub(crate) fn around(&self, offset: usize) -> impl Iterator<Item = (usize, usize)> {
        let cell = self.cell(offset);
        (0..27_usize).filter(|i| *i != 13).filter_map(move |i| {
            let step = [i % 3, i / 3 % 3, i / 9];
            let mut at = [0; 3];
            for a in 0..3 {
                at[a] = (cell[a] + step[a]).checked_sub(1).filter(|&v| v < self.shape[a])?;
            }
            let moved = step.iter().filter(|&&s| s != 1).count();
            Some((self.offset(Cell(at)), moved))
        })
    }

    /// Centre of a cell, LPS mm.
    #[inline]
    pub(crate) fn centre(&self, Cell([x, y, z]): Cell) -> Vec3 {
        let c = |i: usize, a: usize| self.origin[a] + i as f64 * self.edge;
        [c(x, 0), c(y, 1), c(z, 2)]
    }

    /// A ball's radius in cells, squared, for [`super::reach`].
    pub(crate) fn squared(&self, mm: f64) -> u16 {
        let r = mm / self.edge;
        (r * r).floor() as u16
    }
}

/// Calls `f` with the offset and the index of every cell, in order.
pub(crate) fn each_cell(cells: &Cells, mut f: impl FnMut(usize, Cell)) {
    let [nx, ny, nz] = cells.shape;
    let mut offset = 0;
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                f(offset, Cell([x, y, z]));
                offset += 1;
            }
        }
    }
}

/// Edges of a box, mm.
fn extent([low, high]: [Vec3; 2]) -> Vec3 {
    [0, 1, 2].map(|a| high[a] - low[a])
}
