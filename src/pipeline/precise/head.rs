//! Whether the scan shows a head with its skin at all.

use super::levels::Levels;
use super::patient::{Cell, Patient, each_cell};
use super::space::Space;

/// What the patient is made of, cm³.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Head {
    /// Soft tissue that bone surrounds in the plane at right angles to the body: brain.
    pub(super) brain_cm3: f64,
    /// Soft tissue in all.
    pub(super) soft_cm3: f64,
    /// Bone.
    pub(super) bone_cm3: f64,
}

/// Bone is denser than this, HU above soft tissue.
const BONE: f32 = 210.0;
/// Soft tissue differs from its level by no more than this, HU.
const SOFT: f32 = 130.0;

impl Head {
    /// Looks along eight directions from the soft cells for bone.
    pub(super) fn of(space: &Space, levels: &Levels, patient: &Patient) -> Self {
        let cells = &patient.cells;
        let [nx, ny, nz] = cells.shape;
        let kinds: Vec<Matter> = cells.map(|p| match space.sample(p) {
            Some(v) if v > levels.tissue + BONE => Matter::Bone,
            Some(v) if (v - levels.tissue).abs() < SOFT => Matter::Soft,
            _ => Matter::Neither,
        });
        let volume = cells.edge.powi(3) / 1000.0;
        let mut head = Self::default();
        each_cell(cells, |i, _| {
            if patient.kinds[i] == Cell::Patient {
                match kinds[i] {
                    Matter::Bone => head.bone_cm3 += volume,
                    Matter::Soft => head.soft_cm3 += volume,
                    Matter::Neither => {}
                }
            }
        });
        let layer = nx * ny;
        for z in 0..nz {
            let surrounded = surrounded(nx, ny, &kinds[z * layer..][..layer]);
            for i in 0..layer {
                let offset = z * layer + i;
                if surrounded[i] && kinds[offset] == Matter::Soft && patient.kinds[offset] == Cell::Patient {
                    head.brain_cm3 += volume;
                }
            }
        }
        head
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Matter {
    #[default]
    Neither,
    Soft,
    Bone,
}

/// Which cells of a layer have bone in all eight directions.
fn surrounded(nx: usize, ny: usize, layer: &[Matter]) -> Vec<bool> {
    let mut all = vec![true; nx * ny];
    for (dx, dy) in [(1isize, 0isize), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1)] {
        let mut seen = vec![false; nx * ny];
        // Each cell takes over from its neighbour against the direction of the walk.
        let rows: Box<dyn Iterator<Item = usize>> = if dy >= 0 { Box::new(0..ny) } else { Box::new((0..ny).rev()) };
        for y in rows {
            let columns: Box<dyn Iterator<Item = usize>> =
                if dx >= 0 { Box::new(0..nx) } else { Box::new((0..nx).rev()) };
            for x in columns {
                let before = x
                    .checked_add_signed(-dx)
                    .zip(y.checked_add_signed(-dy))
                    .is_some_and(|(x, y)| x < nx && y < ny && seen[y * nx + x]);
                seen[y * nx + x] = before || layer[y * nx + x] == Matter::Bone;
                all[y * nx + x] &= before;
            }
        }
    }
    all
}
