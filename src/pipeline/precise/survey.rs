//! The survey: the scan seen in cubic cells along the patient's axes, coarse enough that the whole
//! scan can be searched in 3D, with every rule in mm whatever the scan's own geometry.

use rayon::prelude::*;

use super::field::Field;
use super::space::{Space, nearest};
use crate::geometry::Vec3;

/// The box around all voxel centres and the margin, LPS mm.
pub(super) fn whole(space: &Space) -> [Vec3; 2] {
    let last = space.shape.map(|n| (n - 1) as f64);
    let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
    for corner in 0..8 {
        let index = [0, 1, 2].map(|a| if corner >> a & 1 == 1 { last[a] } else { 0.0 });
        let p = space.lps(index);
        for a in 0..3 {
            low[a] = low[a].min(p[a] - MARGIN_MM);
            high[a] = high[a].max(p[a] + MARGIN_MM);
        }
    }
    [low, high]
}

fn extent([low, high]: [Vec3; 2]) -> Vec3 {
    [0, 1, 2].map(|a| high[a] - low[a])
}

/// What the scan shows at the centre of every cell.
#[derive(Debug)]
pub(super) struct Survey {
    /// The cells.
    pub(super) cells: Cells,
    /// Hounsfield units, trilinear; beyond the scan those of its nearest voxel.
    pub(super) hu: Vec<i16>,
    /// Whether the cell's centre lies between the scan's outermost voxel centres and in its field of
    /// view.
    pub(super) seen: Vec<bool>,
    /// Whether it lies below the lowest of them.
    pub(super) below: Vec<bool>,
    /// Whether it lies beside the field of view, in the height of the scan.
    pub(super) aside: Vec<bool>,
}

impl Survey {
    /// Samples the scan.
    pub(super) fn of(space: &Space, field: &Field, cells: Cells) -> Self {
        let [nx, ny, _] = cells.shape;
        let mut hu = vec![0; cells.len()];
        let mut seen = vec![false; cells.len()];
        let mut below = vec![false; cells.len()];
        let mut aside = vec![false; cells.len()];
        let values = hu.par_chunks_mut(nx).zip(seen.par_chunks_mut(nx));
        let rows = values.zip(below.par_chunks_mut(nx)).zip(aside.par_chunks_mut(nx));
        rows.enumerate().panic_fuse().for_each(|(row, (((hu, seen), below), aside))| {
            space.ask();
            let start = cells.centre([0, row % ny, row / ny]);
            let line = space.line(start, [cells.edge, 0.0, 0.0]);
            let row = hu.iter_mut().zip(seen).zip(below).zip(aside);
            for (x, (((hu, seen), below), aside)) in row.enumerate() {
                let index = line.index(x as f64);
                let clamped = space.within(index);
                *seen = clamped == index && field.holds(nearest(index));
                *below = index[0] > clamped[0];
                *aside = !*seen && index[0] == clamped[0];
                let v = space.sample_index(clamped).unwrap_or(0.0);
                *hu = (v + 0.5f32.copysign(v)) as i16;
            }
        });
        Self { cells, hu, seen, below, aside }
    }
}

/// Cubic cells along LPS; index `(z · ny + y) · nx + x`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cells {
    /// LPS mm of the centre of cell 0.
    pub(super) origin: Vec3,
    /// Edge, mm.
    pub(super) edge: f64,
    /// `[nx, ny, nz]`.
    pub(super) shape: [usize; 3],
}

/// At most so many cells: the memory and the time that the search may take.
const MOST_CELLS: f64 = 20e6;
/// The survey reaches so far beyond the scan, mm; there the scan's last voxels go on, so that air
/// next to the first slice stays open and a windpipe cut by the last one stays closed.
const MARGIN_MM: f64 = 6.0;

impl Cells {
    /// Cells of at least that edge (mm) over a box in LPS mm, larger ones if those would be too many.
    pub(super) fn over(bounds: [Vec3; 2], least_edge: f64) -> Self {
        let edge = (extent(bounds).iter().product::<f64>() / MOST_CELLS).cbrt().max(least_edge);
        let shape = extent(bounds).map(|e| (e.max(0.0) / edge).floor() as usize + 1);
        Self { origin: bounds[0], edge, shape }
    }

    /// Number of cells.
    pub(super) fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// The cell that holds a place, if it is in the survey.
    #[inline]
    pub(super) fn at(&self, p: Vec3) -> Option<[usize; 3]> {
        let mut cell = [0; 3];
        for a in 0..3 {
            let v = (p[a] - self.origin[a]) / self.edge + 0.5;
            cell[a] = v as usize;
            if !(v >= 0.0 && cell[a] < self.shape[a]) {
                return None;
            }
        }
        Some(cell)
    }

    /// Offset of a cell `[x, y, z]`.
    #[inline]
    pub(super) fn offset(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.shape[1] + y) * self.shape[0] + x
    }

    /// The cell `[x, y, z]` at an offset.
    #[inline]
    pub(super) fn cell(&self, offset: usize) -> [usize; 3] {
        let [nx, ny, _] = self.shape;
        [offset % nx, offset / nx % ny, offset / (nx * ny)]
    }

    /// The cells no more than `reach` away along each axis, those outside the survey left out.
    pub(super) fn block(&self, cell: [usize; 3], reach: usize) -> impl Iterator<Item = [usize; 3]> {
        let range = |a: usize| cell[a].saturating_sub(reach)..(cell[a] + reach + 1).min(self.shape[a]);
        let (xs, ys) = (range(0), range(1));
        range(2).flat_map(move |z| {
            let xs = xs.clone();
            ys.clone().flat_map(move |y| xs.clone().map(move |x| [x, y, z]))
        })
    }

    /// The up to 26 cells around one, with how many axes apart they are.
    pub(super) fn around(&self, offset: usize) -> impl Iterator<Item = (usize, usize)> {
        let cell = self.cell(offset);
        (0..27_usize).filter(|i| *i != 13).filter_map(move |i| {
            let step = [i % 3, i / 3 % 3, i / 9];
            let mut at = [0; 3];
            for a in 0..3 {
                at[a] = (cell[a] + step[a]).checked_sub(1).filter(|&v| v < self.shape[a])?;
            }
            let moved = step.iter().filter(|&&s| s != 1).count();
            Some((self.offset(at), moved))
        })
    }

    /// Centre of a cell, LPS mm.
    #[inline]
    pub(super) fn centre(&self, [x, y, z]: [usize; 3]) -> Vec3 {
        let c = |i: usize, a: usize| self.origin[a] + i as f64 * self.edge;
        [c(x, 0), c(y, 1), c(z, 2)]
    }

    /// A ball's radius in cells, squared, for [`super::reach`].
    pub(super) fn squared(&self, mm: f64) -> u16 {
        let r = mm / self.edge;
        (r * r).floor() as u16
    }
}
