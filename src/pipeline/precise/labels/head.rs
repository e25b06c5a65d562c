//! Whether the scan shows a head with its skin at all, and where it ends.

use std::ops::Range;

use rayon::prelude::*;

use super::label::Label;
use super::patient::Patient;
use crate::geometry::Vec3;
use crate::pipeline::precise::grid::index::Cell;
use crate::pipeline::precise::grid::rays::{Seen, view};
use crate::pipeline::precise::scan::Scan;
use crate::pipeline::precise::scan::survey::Survey;

/// The patient's head in the survey.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Head {
    /// Soft tissue in a closed shell of bone, cm³: brain.
    pub(crate) brain_cm3: f64,
    /// Its middle, LPS mm.
    pub(crate) middle: Vec3,
    /// LPS z of the narrowest layer below it, the neck; the lowest layer if no neck is in view.
    pub(crate) lower_end: f64,
    /// Metal, cm³.
    pub(crate) metal_cm3: f64,
    /// Cut through the head by the scan's upper end, cm².
    pub(crate) cut_above_cm2: f64,
    /// Cut through it by the lower end, cm²: none if the neck is in view.
    pub(crate) cut_below_cm2: f64,
    /// Cut through it at the sides of the slices, cm².
    pub(crate) cut_at_side_cm2: f64,
}

/// Bone is denser than this, HU above soft tissue.
const BONE: f32 = 210.0;
/// Metal is denser than this, HU.
const METAL: f32 = 2800.0;
/// Soft tissue differs from its level by no more than this, HU.
const SOFT: f32 = 130.0;
/// Every so many cells along each axis are asked whether they are brain.
const STRIDE: usize = 4;
/// Bone is met in this share of the directions from a brain, those left out that leave the scan:
/// the ribs of a chest let more of them pass.
const CLOSED: f64 = 0.84;
/// So many of the 26 directions must not leave the scan.
const LEAST_DIRECTIONS: usize = 12;
/// A layer with this share of the widest layer of the head is the neck.
const NECK: f64 = 0.62;
/// No layer of a head is larger, cm² (one of 180 mm by 230 mm has 325): a chest's is, and where its
/// ribs are close enough to pass for a shell that tells the two apart.
const WIDEST_HEAD_CM2: f64 = 450.0;
/// Brain fills this share of the layers that count for it: a chest's ribs never close around so
/// much.
const BRAIN_SHARE: f64 = 0.55;
/// A layer with so much brain is one of the head, cm².
const BRAIN_LAYER_CM2: f64 = 20.0;

impl Head {
    /// Looks for soft tissue in a closed shell of bone.
    pub(crate) fn of(scan: &Scan<'_>, patient: &Patient) -> Self {
        let sampler = &scan.sampler;
        let Survey { cells, hu, seen, .. } = &patient.survey;
        let [nx, ny, nz] = cells.shape;
        let cell_cm3 = cells.edge.powi(3) / 1000.0;
        let brain = brain(scan, patient);
        let of_layer = |z: usize| {
            sampler.ask();
            let mut layer = Layer::default();
            for i in z * nx * ny..(z + 1) * nx * ny {
                layer.visible |= seen[i];
                if patient.labels[i] == Label::Patient && seen[i] {
                    layer.area += 1;
                    layer.metal += usize::from(f32::from(hu[i]) > METAL);
                    layer.cut_below += usize::from(z > 0 && !seen[i - nx * ny]);
                    // A cell at the survey's own border has the scan's within its margin.
                    let beside = [i.wrapping_sub(1), i + 1, i.wrapping_sub(nx), i + nx];
                    layer.cut |= beside.into_iter().any(|j| seen.get(j) == Some(&false));
                }
            }
            layer
        };
        let of_survey: Vec<Layer> = (0..nz).into_par_iter().panic_fuse().map(of_layer).collect();
        let cm2 = |cells_: usize| cells_ as f64 * cells.edge * cells.edge / 100.0;
        let layers: Vec<f64> = brain.iter().map(|l| cm2(l.len() * STRIDE * STRIDE)).collect();
        let of_patient = |z: usize| cm2(of_survey[z * STRIDE].area);
        let is_skull =
            |&z: &usize| of_patient(z) <= WIDEST_HEAD_CM2 && layers[z] >= BRAIN_SHARE * of_patient(z);
        let of_head = largest_run(&layers, |z| of_patient(z) <= WIDEST_HEAD_CM2);
        let brain_mm3 = of_head.clone().filter(is_skull).fold(0.0, |sum, z| sum + layers[z] * 100.0)
            * STRIDE as f64
            * cells.edge;
        let of_brain = || brain[of_head.clone()].iter().flatten();
        let count = of_brain().count();
        let mut middle = [0.0; 3];
        for cell in of_brain() {
            for (m, p) in middle.iter_mut().zip(cells.centre(*cell)) {
                *m += p / count as f64;
            }
        }
        let ends = Ends::of(&of_survey, of_head.start * STRIDE..of_head.end * STRIDE);
        let mut head = Self {
            brain_cm3: brain_mm3 / 1000.0,
            middle,
            lower_end: cells.centre(Cell([0, 0, ends.lowest]))[2] - 0.5 * cells.edge,
            metal_cm3: of_survey.iter().map(|l| l.metal).sum::<usize>() as f64 * cell_cm3,
            cut_above_cm2: 0.0,
            cut_below_cm2: if ends.neck { 0.0 } else { cm2(ends.cut) },
            cut_at_side_cm2: 0.0,
        };
        head.find_cuts(scan, patient, ends.lowest);
        head
    }

    /// Where the head leaves the scan above and at the sides: its cells next to the scan's borders.
    fn find_cuts(&mut self, scan: &Scan<'_>, patient: &Patient, lowest: usize) {
        let Scan { sampler, field_of_view, .. } = scan;
        let Survey { cells, seen, .. } = &patient.survey;
        let step = [1, cells.shape[0], cells.shape[0] * cells.shape[1]];
        let of_cell = |i: usize| {
            sampler.ask_at(i);
            let (cell, mut above, mut aside) = (cells.cell(i), 0_usize, 0_usize);
            for axis in 0..3 {
                let below = (cell[axis] > 0).then(|| (i - step[axis], -cells.edge));
                let beyond = (cell[axis] + 1 < cells.shape[axis]).then(|| (i + step[axis], cells.edge));
                for (_, way) in below.into_iter().chain(beyond).filter(|(j, _)| !seen[*j]) {
                    let mut p = cells.centre(cell);
                    p[axis] += way;
                    let index = sampler.index(p);
                    let left = |a: usize| index[a] < 0.0 || index[a] > (sampler.shape[a] - 1) as f64;
                    let filled = sampler.within(index) == index && !field_of_view.holds(index.nearest());
                    let upward = axis == 2 && way > 0.0;
                    above += usize::from(upward);
                    aside += usize::from(axis != 2 && (filled || [1, 2].into_iter().any(left)));
                }
            }
            (above, aside)
        };
        let (above, aside) = (lowest * step[2]..cells.len())
            .into_par_iter()
            .panic_fuse()
            .filter(|&i| patient.labels[i] == Label::Patient && seen[i])
            .map(of_cell)
            .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        let face = cells.edge * cells.edge / 100.0;
        self.cut_above_cm2 = above as f64 * face;
        self.cut_at_side_cm2 = aside as f64 * face;
    }
}

/// The cells that are brain, of every so many along each axis, by layer: soft tissue in a closed shell of
/// bone.
fn brain(scan: &Scan<'_>, patient: &Patient) -> Vec<Vec<Cell>> {
    let Scan { sampler, levels, .. } = scan;
    let Survey { cells, hu, seen, .. } = &patient.survey;
    let [nx, ny, nz] = cells.shape;
    let bone = levels.tissue + BONE;
    let look = |i: usize| match f32::from(hu[i]) {
        _ if !seen[i] => Seen::Nothing,
        v if v > bone => Seen::Wanted,
        _ => Seen::Other,
    };
    let is_brain = |i: usize| {
        let soft = seen[i] && (f32::from(hu[i]) - levels.tissue).abs() < SOFT;
        soft && patient.labels[i] == Label::Patient && {
            let (met, ended) = view(cells, i, look);
            ended >= LEAST_DIRECTIONS && met as f64 >= CLOSED * ended as f64
        }
    };
    let of_layer = |z: usize| {
        sampler.ask();
        let layer = (0..ny.div_ceil(STRIDE))
            .flat_map(|y| (0..nx.div_ceil(STRIDE)).map(move |x| Cell([x * STRIDE, y * STRIDE, z * STRIDE])));
        layer.filter(|&cell| is_brain(cells.offset(cell))).collect()
    };
    (0..nz.div_ceil(STRIDE)).into_par_iter().panic_fuse().map(of_layer).collect()
}

/// The run of neighbouring layers with enough brain that holds most of it; areas in cm².
fn largest_run(layers: &[f64], may_be: impl Fn(usize) -> bool) -> Range<usize> {
    let (mut best, mut most) = (0..0, 0.0);
    let mut start = 0;
    for end in 0..=layers.len() {
        if end == layers.len() || layers[end] < BRAIN_LAYER_CM2 || !may_be(end) {
            let sum: f64 = layers[start..end].iter().sum();
            if sum > most {
                (best, most) = (start..end, sum);
            }
            start = end + 1;
        }
    }
    best
}

/// The patient in a layer of the survey, in cells.
#[derive(Debug, Clone, Copy, Default)]
struct Layer {
    /// Whether the scan shows any of the layer.
    visible: bool,
    /// Of the patient.
    area: usize,
    /// Of metal.
    metal: usize,
    /// Of the patient, with nothing shown below.
    cut_below: usize,
    /// Whether the scan ends within the patient beside some cell: a tilted scan's first layers, and
    /// what leaves the field of view.
    cut: bool,
}

/// Where the head ends below, in layers of the survey.
struct Ends {
    lowest: usize,
    neck: bool,
    /// Cells of the patient that the scan's lower end cuts.
    cut: usize,
}

impl Ends {
    /// From every layer, lowest first, and which of them hold the brain. A layer that is not shown
    /// whole may look as narrow as a neck.
    fn of(layers: &[Layer], of_head: Range<usize>) -> Self {
        let first = layers.iter().position(|l| l.visible).unwrap_or(0);
        let lowest_brain = of_head.start.max(first);
        let widest = of_head.filter_map(|z| layers.get(z)).map(|l| l.area).max().unwrap_or(0) as f64;
        let whole = (first..=lowest_brain).filter(|&z| layers[z].area > 0 && !layers[z].cut);
        match whole.min_by_key(|&z| layers[z].area) {
            Some(z) if (layers[z].area as f64) < NECK * widest => Self { lowest: z, neck: true, cut: 0 },
            _ => {
                let cut = layers.iter().map(|l| l.cut_below).sum();
                Self { lowest: first, neck: false, cut }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_head_ends_at_its_neck_or_is_cut() {
        let brain = 60..120;
        // Shoulders, neck, jaw, cranium.
        let area = |z: usize| match z {
            0..20 => 400,
            20..40 => 100,
            40..60 => 180,
            60..120 => 220,
            _ => 0,
        };
        let layer = |z| Layer { visible: true, area: area(z), ..Layer::default() };
        let whole: Vec<Layer> = (0..140).map(layer).collect();
        let ends = Ends::of(&whole, brain.clone());
        assert!(ends.neck && (20..40).contains(&ends.lowest), "{}", ends.lowest);
        let cut_at = |z: usize| match z {
            0..45 => Layer::default(),
            45 => Layer { cut_below: area(z), ..layer(z) },
            _ => layer(z),
        };
        let ends = Ends::of(&(0..140).map(cut_at).collect::<Vec<_>>(), brain.clone());
        assert!(!ends.neck);
        assert_eq!((ends.lowest, ends.cut), (45, 180));
        // A tilted scan shows ever more of the layers from 45 to 65.
        let tilted = |z: usize| match z {
            0..45 => Layer::default(),
            45..65 => Layer { area: area(z) * (z - 44) / 21, cut_below: area(z) / 21, cut: true, ..layer(z) },
            _ => layer(z),
        };
        let ends = Ends::of(&(0..140).map(tilted).collect::<Vec<_>>(), brain);
        assert!(!ends.neck && ends.cut > 150, "{}", ends.cut);
    }
}
