//! The field of view: which part of the images was reconstructed.
//!
//! A scanner reconstructs a circle and fills the rest of the square with one value, marked as padding
//! (PS3.3 section C.7.5.1.1.2) or not. Where the patient reaches that circle there is a border that is
//! no skin.

use rayon::prelude::*;

use super::levels::Levels;
use super::sampler::Sampler;
use crate::geometry::norm;
use crate::pipeline::precise::grid::index::Voxel;

/// A border no more voxels than this from what was filled is none that was measured.
pub(crate) const RIM: usize = 2;

/// How far every line of voxels is from one that holds nothing but the fill value.
#[derive(Debug, Default)]
pub(crate) struct FieldOfView {
    /// For the lines along each axis, by the other two's indices in order: in voxels, the larger of
    /// the two differences; empty where no line is filled.
    distance: [Vec<u8>; 3],
    shape: [usize; 3],
}

impl FieldOfView {
    /// Compares every line with those at the corners of the image.
    pub(crate) fn of(sampler: &Sampler, levels: &Levels) -> Self {
        let mut field = Self { shape: sampler.shape, ..Self::default() };
        for axis in 0..3 {
            let Some(value) = fill_value(sampler, levels, axis) else { continue };
            let [rows, columns] = others(axis).map(|a| sampler.shape[a]);
            let is_filled = |line: usize| {
                sampler.ask_at(line);
                voxels(sampler, axis, line).all(|v| v == value)
            };
            let mut filled: Vec<bool> =
                (0..rows * columns).into_par_iter().panic_fuse().map(is_filled).collect();
            if levels.is_still_air(f32::from(value)) {
                // Air itself can have the value all along a line, the patient's too: the circle alone tells.
                let circle = (axis == sampler.slice_axis()).then(|| Circle::around(sampler, axis, &filled));
                let Some(circle) = circle.filter(|c| c.cuts_tissue(sampler, levels, value)) else { continue };
                filled.iter_mut().enumerate().for_each(|(line, is)| *is &= circle.is_near_or_beyond(line));
            }
            field.distance[axis] = distances(&filled, columns);
        }
        field
    }

    /// Whether a voxel was reconstructed.
    #[inline]
    pub(crate) fn holds(&self, voxel: Voxel) -> bool {
        self.is_whole() || self.distance(voxel) != Some(0)
    }

    /// Whether all of the images was reconstructed.
    fn is_whole(&self) -> bool {
        self.distance.iter().all(Vec::is_empty)
    }

    /// How many voxels one is from what was not reconstructed; `None` if more than [`RIM`].
    #[inline]
    pub(crate) fn distance(&self, voxel: Voxel) -> Option<usize> {
        let along = |axis: usize| {
            let [a, b] = others(axis);
            self.distance[axis].get(voxel[a] * self.shape[b] + voxel[b]).copied()
        };
        (0..3).filter_map(along).min().map(usize::from).filter(|&d| d <= RIM)
    }
}

fn others(axis: usize) -> [usize; 2] {
    [[1, 2], [0, 2], [0, 1]][axis]
}

/// The voxels of a line along `axis`; lines count by the other two's indices in order.
fn voxels<'a>(sampler: &'a Sampler, axis: usize, line: usize) -> impl Iterator<Item = i16> + 'a {
    let [a, b] = others(axis);
    let mut voxel = [0; 3];
    (voxel[a], voxel[b]) = (line / sampler.shape[b], line % sampler.shape[b]);
    let (first, stride) = (sampler.offset(Voxel(voxel)), sampler.stride(axis));
    (0..sampler.shape[axis]).map(move |i| sampler.hu[first + i * stride])
}

/// The one value of a whole line at a corner; one that can be air that was measured only if no corner
/// has another.
fn fill_value(sampler: &Sampler, levels: &Levels, axis: usize) -> Option<i16> {
    let [rows, columns] = others(axis).map(|a| sampler.shape[a]);
    let corners = [0, columns - 1, (rows - 1) * columns, rows * columns - 1];
    let constant = |line: usize| {
        let value = voxels(sampler, axis, line).next()?;
        let is_one = f32::from(value) < levels.middle() && voxels(sampler, axis, line).all(|v| v == value);
        is_one.then_some(value)
    };
    let values: Vec<i16> = corners.into_iter().filter_map(constant).collect();
    values.iter().copied().find(|&v| !levels.is_still_air(f32::from(v))).or(values.first().copied())
}

/// The smallest circle around the middle of the slices that leaves nothing but the fill value outside.
struct Circle {
    axis: usize,
    shape: [usize; 2],
    spacing: [f64; 2],
    /// Squared, mm².
    radius: f64,
}

impl Circle {
    fn around(sampler: &Sampler, axis: usize, filled: &[bool]) -> Self {
        let shape = others(axis).map(|a| sampler.shape[a]);
        let spacing = others(axis).map(|a| norm(sampler.mean_step(a)));
        let mut circle = Self { axis, shape, spacing, radius: 0.0 };
        let held = (0..filled.len()).filter(|&line| !filled[line]).map(|line| circle.distance(line));
        circle.radius = held.fold(0.0, f64::max);
        circle
    }

    /// Of a line from the middle, squared, mm².
    fn distance(&self, line: usize) -> f64 {
        let at = [line / self.shape[1], line % self.shape[1]];
        (0..2).map(|i| ((at[i] as f64 - (self.shape[i] - 1) as f64 / 2.0) * self.spacing[i]).powi(2)).sum()
    }

    fn is_beyond(&self, line: usize) -> bool {
        self.distance(line) > self.radius
    }

    /// Scan circles lie a little beside the middle.
    fn is_near_or_beyond(&self, line: usize) -> bool {
        self.distance(line).sqrt() > self.radius.sqrt() - ASIDE * self.spacing[0].max(self.spacing[1])
    }

    /// Whether tissue ends at the circle without an edge, as only what was cut does: the scanner blurs
    /// every true border.
    fn cuts_tissue(&self, sampler: &Sampler, levels: &Levels, fill: i16) -> bool {
        let [rows, columns] = self.shape;
        let (mut rim, mut cut, mut anything, mut tissue) = (0usize, 0usize, 0usize, 0usize);
        for (r, c) in (1..rows - 1).flat_map(|r| (1..columns - 1).map(move |c| (r, c))) {
            let line = r * columns + c;
            sampler.ask_at(line);
            let beside = [line - columns, line - 1, line + 1, line + columns];
            if self.is_beyond(line) || !beside.into_iter().any(|l| self.is_beyond(l)) {
                continue;
            }
            let values = || voxels(sampler, self.axis, line).map(f32::from);
            let full = values().filter(|&v| v >= levels.upper()).count();
            rim += 1;
            cut += usize::from(full > 0);
            tissue += full;
            anything += values().filter(|&v| v > f32::from(fill) + FAINT).count();
        }
        cut as f64 >= CUT_RIM * rim as f64 && rim > 0 && tissue as f64 >= WITHOUT_EDGE * anything as f64
    }
}

/// How far within the circle around the middle the true one may run, pixels.
const ASIDE: f64 = 4.0;
/// Tissue at less of the circle than this is none that it cuts.
const CUT_RIM: f64 = 0.1;
/// Of the voxels at the circle that hold more than air, so many are full of tissue where it is cut.
const WITHOUT_EDGE: f64 = 0.8;
/// A voxel further above the fill value than this holds more than air, HU.
const FAINT: f32 = 100.0;

/// The distance of every place of a plane from the nearest one that is marked, up to one more than
/// [`RIM`].
fn distances(marked: &[bool], columns: usize) -> Vec<u8> {
    let rows = marked.len() / columns;
    let of = |i: usize| {
        let (row, column) = (i / columns, i % columns);
        let near = |reach: usize| {
            let rows = row.saturating_sub(reach)..(row + reach + 1).min(rows);
            let within = column.saturating_sub(reach)..(column + reach + 1).min(columns);
            rows.into_iter().any(|r| within.clone().any(|c| marked[r * columns + c]))
        };
        (0..=RIM).find(|&reach| near(reach)).unwrap_or(RIM + 1) as u8
    };
    (0..marked.len()).into_par_iter().map(of).collect()
}
