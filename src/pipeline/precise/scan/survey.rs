//! The survey: the scan seen in cubic cells along the patient's axes, coarse enough that the whole
//! scan can be searched in 3D, with every rule in mm whatever the scan's own geometry.

use rayon::prelude::*;

use super::field_of_view::FieldOfView;
use super::sampler::Sampler;
use crate::geometry::Vec3;
use crate::pipeline::precise::grid::cells::Cells;
use crate::pipeline::precise::grid::index::{Cell, VoxelPlace};

/// The survey reaches so far beyond the scan, mm; there the scan's last voxels go on, so that air
/// next to the first slice stays open and a windpipe cut by the last one stays closed.
const MARGIN_MM: f64 = 6.0;

/// The box around all voxel centres and the margin, LPS mm.
pub(crate) fn whole(sampler: &Sampler) -> [Vec3; 2] {
    let last = sampler.shape.map(|n| (n - 1) as f64);
    let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
    for corner in 0..8 {
        let index = [0, 1, 2].map(|a| if corner >> a & 1 == 1 { last[a] } else { 0.0 });
        let p = sampler.lps(VoxelPlace(index));
        for a in 0..3 {
            low[a] = low[a].min(p[a] - MARGIN_MM);
            high[a] = high[a].max(p[a] + MARGIN_MM);
        }
    }
    [low, high]
}

/// What the scan shows at the centre of every cell.
#[derive(Debug)]
pub(crate) struct Survey {
    /// The cells.
    pub(crate) cells: Cells,
    /// Hounsfield units, trilinear; beyond the scan those of its nearest voxel.
    pub(crate) hu: Vec<i16>,
    /// Whether the cell's centre lies between the scan's outermost voxel centres and in its field of
    /// view.
    pub(crate) seen: Vec<bool>,
    /// Whether it lies below the lowest of them.
    pub(crate) below: Vec<bool>,
    /// Whether it lies beside the field of view, in the height of the scan.
    pub(crate) aside: Vec<bool>,
}

impl Survey {
    /// Samples the scan.
    pub(crate) fn of(sampler: &Sampler, field: &FieldOfView, cells: Cells) -> Self {
        let [nx, ny, _] = cells.shape;
        let mut hu = vec![0; cells.len()];
        let mut seen = vec![false; cells.len()];
        let mut below = vec![false; cells.len()];
        let mut aside = vec![false; cells.len()];
        let values = hu.par_chunks_mut(nx).zip(seen.par_chunks_mut(nx));
        let rows = values.zip(below.par_chunks_mut(nx)).zip(aside.par_chunks_mut(nx));
        rows.enumerate().panic_fuse().for_each(|(row, (((hu, seen), below), aside))| {
            sampler.ask();
            let start = cells.centre(Cell([0, row % ny, row / ny]));
            let line = sampler.line(start, [cells.edge, 0.0, 0.0]);
            let row = hu.iter_mut().zip(seen).zip(below).zip(aside);
            for (x, (((hu, seen), below), aside)) in row.enumerate() {
                let index = line.index(x as f64);
                let clamped = sampler.within(index);
                *seen = clamped == index && field.holds(index.nearest());
                *below = index[0] > clamped[0];
                *aside = !*seen && index[0] == clamped[0];
                let v = sampler.sample_index(clamped).unwrap_or(0.0);
                *hu = (v + 0.5f32.copysign(v)) as i16;
            }
        });
        Self { cells, hu, seen, below, aside }
    }
}
