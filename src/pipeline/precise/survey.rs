//! The survey: the scan seen in cubic cells along the patient's axes, coarse enough that the whole
//! scan can be searched in 3D, with every rule in mm whatever the scan's own geometry.

use rayon::prelude::*;

use super::space::Space;
use crate::geometry::Vec3;

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
const MOST_CELLS: f64 = 14e6;
/// The survey reaches so far beyond the scan, mm; there the scan's last voxels go on, so that air
/// next to the first slice stays open and a windpipe cut by the last one stays closed.
const MARGIN_MM: f64 = 6.0;

impl Cells {
    /// Cells of 1 mm over the volume, larger ones if that would be too many.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)]
    pub(super) fn over(space: &Space) -> Self {
        let last = space.shape.map(|n| (n - 1) as f64);
        let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
        for corner in 0..8 {
            let index = [0, 1, 2].map(|a| if corner >> a & 1 == 1 { last[a] } else { 0.0 });
            let p = space.lps(index);
            for a in 0..3 {
                low[a] = low[a].min(p[a]);
                high[a] = high[a].max(p[a]);
            }
        }
        let low = low.map(|v| v - MARGIN_MM);
        let extent = [0, 1, 2].map(|a| high[a] + MARGIN_MM - low[a]);
        let edge = (extent.iter().product::<f64>() / MOST_CELLS).cbrt().max(1.0);
        let shape = extent.map(|e| (e / edge).floor() as usize + 1);
        Self { origin: low, edge, shape }
    }

    /// Number of cells.
    pub(super) fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// The cell that holds a place, if it is in the survey.
    #[inline]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub(super) fn at(&self, p: Vec3) -> Option<[usize; 3]> {
        let mut cell = [0; 3];
        for a in 0..3 {
            let v = ((p[a] - self.origin[a]) / self.edge + 0.5).floor();
            if v < 0.0 || v as usize >= self.shape[a] {
                return None;
            }
            cell[a] = v as usize;
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

    /// The up to 26 cells around one, with their distance, mm.
    pub(super) fn around(&self, offset: usize) -> impl Iterator<Item = (usize, f64)> {
        let cell = self.cell(offset);
        (0..27_usize).filter(|i| *i != 13).filter_map(move |i| {
            let step = [i % 3, i / 3 % 3, i / 9];
            let mut at = [0; 3];
            for a in 0..3 {
                at[a] = (cell[a] + step[a]).checked_sub(1).filter(|&v| v < self.shape[a])?;
            }
            let moved = step.iter().filter(|&&s| s != 1).count();
            Some((self.offset(at), [0.0, 1.0, 2f64.sqrt(), 3f64.sqrt()][moved] * self.edge))
        })
    }

    /// Centre of a cell, LPS mm.
    #[inline]
    #[expect(clippy::cast_precision_loss)]
    pub(super) fn centre(&self, [x, y, z]: [usize; 3]) -> Vec3 {
        let c = |i: usize, a: usize| self.origin[a] + i as f64 * self.edge;
        [c(x, 0), c(y, 1), c(z, 2)]
    }

    /// A value for every cell, made from its centre's place.
    pub(super) fn map<T: Send + Copy + Default>(&self, f: impl Fn(Vec3) -> T + Sync) -> Vec<T> {
        let mut out = vec![T::default(); self.len()];
        let [nx, ny, _] = self.shape;
        out.par_chunks_mut(nx * ny).enumerate().for_each(|(z, layer)| {
            for (i, v) in layer.iter_mut().enumerate() {
                *v = f(self.centre([i % nx, i / nx, z]));
            }
        });
        out
    }

    /// A ball's radius in cells, squared, for [`super::distance`].
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub(super) fn squared(&self, mm: f64) -> u16 {
        let r = mm / self.edge;
        (r * r).floor() as u16
    }
}
