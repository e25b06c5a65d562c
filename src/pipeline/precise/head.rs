//! Whether the scan shows a head with its skin at all.

use super::levels::Levels;
use super::patient::{Cell, Patient, each_cell};
use super::space::Space;
use crate::geometry::{Vec3, add, scale};

/// What the patient is made of, cm³.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Head {
    /// Soft tissue that bone surrounds in the plane at right angles to the body: brain.
    pub(super) brain_cm3: f64,
    /// Soft tissue in all.
    pub(super) soft_cm3: f64,
    /// Bone.
    pub(super) bone_cm3: f64,
    /// Metal.
    pub(super) metal_cm3: f64,
    /// Area of brain in the lowest layer in view, cm²: where the scan ends within the skull.
    pub(super) brain_cut_cm2: f64,
    /// Area of the patient in the first and last slice's place above, cm².
    pub(super) cut_above_cm2: f64,
    /// Area of the patient at the sides of the slices, cm².
    pub(super) cut_aside_cm2: f64,
}

/// Bone is denser than this, HU above soft tissue.
const BONE: f32 = 210.0;
/// Metal is denser than this, HU.
const METAL: f32 = 2800.0;
/// Soft tissue differs from its level by no more than this, HU.
const SOFT: f32 = 130.0;

impl Head {
    /// Looks along eight directions from the soft cells for bone.
    pub(super) fn of(space: &Space, levels: &Levels, patient: &Patient) -> Self {
        let cells = &patient.cells;
        let [nx, ny, nz] = cells.shape;
        let kinds: Vec<Matter> = cells.map(|p| match space.sample(p) {
            Some(v) if v > METAL => Matter::Metal,
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
                    Matter::Metal => head.metal_cm3 += volume,
                    Matter::Soft => head.soft_cm3 += volume,
                    Matter::Neither => {}
                }
            }
        });
        let layer = nx * ny;
        let mut lowest: Option<f64> = None;
        for z in 0..nz {
            let before = head.brain_cm3;
            let surrounded = surrounded(nx, ny, &kinds[z * layer..][..layer]);
            for i in 0..layer {
                let offset = z * layer + i;
                if surrounded[i] && kinds[offset] == Matter::Soft && patient.kinds[offset] == Cell::Patient {
                    head.brain_cm3 += volume;
                }
            }
            let seen = (0..layer).any(|i| space.contains(cells.centre([i % nx, i / nx, z])));
            if seen && lowest.is_none() {
                lowest = Some((head.brain_cm3 - before) * 10.0 / cells.edge);
            }
        }
        head.brain_cut_cm2 = lowest.unwrap_or(0.0);
        head.find_cuts(space, patient);
        head
    }

    /// Where the patient leaves the scan: its cells next to the scan's borders.
    #[expect(clippy::cast_precision_loss)]
    fn find_cuts(&mut self, space: &Space, patient: &Patient) {
        let cells = &patient.cells;
        let area = cells.edge * cells.edge / 100.0;
        let s = space.slice_axis();
        let up = if space.slice_normal()[2] >= 0.0 { 1.0 } else { -1.0 };
        each_cell(cells, |i, cell| {
            if patient.kinds[i] != Cell::Patient {
                return;
            }
            let p = cells.centre(cell);
            if !space.contains(p) {
                return;
            }
            let leaves = |n: Vec3| !space.contains(add(p, scale(n, cells.edge)));
            if s == 0
                && leaves([0.0, 0.0, 1.0])
                && (space.index(p)[0] < space.shape[0] as f64 / 2.0) == (up < 0.0)
            {
                self.cut_above_cm2 += area;
            }
            for n in [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]] {
                let index = space.index(add(p, scale(n, cells.edge)));
                let aside = (0..3)
                    .filter(|&a| a != s)
                    .any(|a| index[a] < 0.0 || index[a] > (space.shape[a] - 1) as f64);
                self.cut_aside_cm2 += if aside { area } else { 0.0 };
            }
        });
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Matter {
    #[default]
    Neither,
    Soft,
    Bone,
    Metal,
}

/// Which cells of a layer have bone in all eight directions.
fn surrounded(nx: usize, ny: usize, layer: &[Matter]) -> Vec<bool> {
    let mut all = vec![true; nx * ny];
    for (dx, dy) in [(1isize, 0isize), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1)] {
        let mut seen = vec![false; nx * ny];
        // Each cell takes over from its neighbour against the direction of the walk.
        let rows: Box<dyn Iterator<Item = usize>> =
            if dy >= 0 { Box::new(0..ny) } else { Box::new((0..ny).rev()) };
        for y in rows {
            let columns: Box<dyn Iterator<Item = usize>> =
                if dx >= 0 { Box::new(0..nx) } else { Box::new((0..nx).rev()) };
            for x in columns {
                let before = x
                    .checked_add_signed(-dx)
                    .zip(y.checked_add_signed(-dy))
                    .is_some_and(|(x, y)| x < nx && y < ny && seen[y * nx + x]);
                seen[y * nx + x] = before || matches!(layer[y * nx + x], Matter::Bone | Matter::Metal);
                all[y * nx + x] &= before;
            }
        }
    }
    all
}
