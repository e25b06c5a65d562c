//! Whether the scan shows a head with its skin at all.

use rayon::prelude::*;

use super::levels::Levels;
use super::patient::{Cell, Patient, each_cell};
use super::space::Space;
use super::survey::Survey;
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
        let Survey { cells, hu, seen } = &patient.survey;
        let [nx, ny, _] = cells.shape;
        let matter = |(&hu, &seen): (&i16, &bool)| match f32::from(hu) {
            _ if !seen => Matter::Neither,
            v if v > METAL => Matter::Metal,
            v if v > levels.tissue + BONE => Matter::Bone,
            v if (v - levels.tissue).abs() < SOFT => Matter::Soft,
            _ => Matter::Neither,
        };
        let kinds: Vec<Matter> = hu.par_iter().zip(seen).map(matter).collect();
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
        let brain: Vec<(u64, bool)> = kinds
            .par_chunks(layer)
            .enumerate()
            .map(|(z, matter)| {
                let surrounded = surrounded(nx, ny, matter);
                let of_patient = &patient.kinds[z * layer..][..layer];
                let is_brain =
                    |i: &usize| surrounded[*i] && matter[*i] == Matter::Soft && of_patient[*i] == Cell::Patient;
                let is_seen = seen[z * layer..][..layer].contains(&true);
                ((0..layer).filter(is_brain).count() as u64, is_seen)
            })
            .collect();
        #[expect(clippy::cast_precision_loss, reason = "a survey has far fewer than 2^53 cells")]
        let cm3 = |cells: u64| cells as f64 * volume;
        head.brain_cm3 = cm3(brain.iter().map(|b| b.0).sum());
        head.brain_cut_cm2 = brain.iter().find(|b| b.1).map_or(0.0, |b| cm3(b.0) * 10.0 / cells.edge);
        head.find_cuts(space, patient);
        head
    }

    /// Where the patient leaves the scan: its cells next to the scan's borders.
    #[expect(clippy::cast_precision_loss, reason = "a volume's axes are shorter than 2^53 voxels")]
    fn find_cuts(&mut self, space: &Space, patient: &Patient) {
        let Survey { cells, seen, .. } = &patient.survey;
        let area = cells.edge * cells.edge / 100.0;
        let s = space.slice_axis();
        let [nx, ny, nz] = cells.shape;
        let leaving = |offset: usize, [x, y, z]: [usize; 3]| {
            let step = [1, nx, nx * ny];
            let (at, last) = ([x, y, z], [nx - 1, ny - 1, nz - 1]);
            (0..3).flat_map(move |a| {
                let below = (at[a] > 0).then(|| (offset - step[a], a, -1.0));
                let above = (at[a] < last[a]).then(|| (offset + step[a], a, 1.0));
                below.into_iter().chain(above)
            })
        };
        let (mut above, mut aside) = (0usize, 0usize);
        each_cell(cells, |i, cell| {
            if patient.kinds[i] != Cell::Patient || !seen[i] {
                return;
            }
            for (_, axis, direction) in leaving(i, cell).filter(|n| !seen[n.0]) {
                let mut p = cells.centre(cell);
                p[axis] += direction * cells.edge;
                let index = space.index(p);
                let left = |a: usize| index[a] < 0.0 || index[a] > (space.shape[a] - 1) as f64;
                if left(s) {
                    above += usize::from(axis == 2 && direction > 0.0);
                } else if (0..3).any(|a| a != s && left(a)) {
                    aside += 1;
                }
            }
        });
        self.cut_above_cm2 = above as f64 * area;
        self.cut_aside_cm2 = aside as f64 * area;
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
