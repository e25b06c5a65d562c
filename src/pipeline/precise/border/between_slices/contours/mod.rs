//! The contours of the slices as distances, and the skin that they tell of between two of them.

mod bend;
mod skin;

use rayon::prelude::*;

use crate::geometry::{Vec3, dot, norm, scale};
use crate::pipeline::precise::border::caps::{self, Place};
use crate::pipeline::precise::border::crossing::Crossing;
use crate::pipeline::precise::scan::sampler::Sampler;

/// Where the contour moves further than so many gaps from one slice to the next, nobody can tell
/// how: the tip of an ear ends somewhere between.
const FLATTEST: f64 = 4.0;
/// A distance is trusted only if its foot lies across the contour, not beyond its end: the least
/// cosine.
const ACROSS: f64 = 0.8;

/// A head is no quadric: what that makes of a cap's height, in gaps.
const ROUNDNESS: f64 = 0.02;

/// A point of a slice's contour: place and normal in the slice, mm.
#[derive(Debug, Clone, Copy)]
struct Foot {
    at: Place,
    normal: [f64; 2],
}

/// The signed distance to the contour of every slice, mm, in the part of the slices that the skin
/// takes; NaN where it is not known.
#[derive(Debug)]
pub(crate) struct Contours {
    axes: [usize; 2],
    low: [usize; 2],
    shape: [usize; 2],
    spacing: [f64; 2],
    units: [Vec3; 2],
    /// From each slice to the next, mm.
    gaps: Vec<f64>,
    /// The contour of every slice.
    places: Vec<Vec<Place>>,
    distances: Vec<Vec<f32>>,
}

impl Contours {
    /// `gaps` between the slices, mm.
    pub(crate) fn of(sampler: &Sampler, gaps: &[f64], crossings: &[Crossing]) -> Option<Self> {
        let slice_axis = sampler.slice_axis();
        let axes: [usize; 2] = match slice_axis {
            0 => [1, 2],
            1 => [0, 2],
            _ => [0, 1],
        };
        let spacing = axes.map(|a| norm(sampler.mean_step(a)));
        let units = [0, 1].map(|i| scale(sampler.mean_step(axes[i]), 1.0 / spacing[i]));
        let mut feet: Vec<Vec<Foot>> = vec![Vec::new(); sampler.shape[slice_axis]];
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        for (i, c) in crossings.iter().enumerate().filter(|(_, c)| usize::from(c.axis) != slice_axis) {
            sampler.ask_at(i);
            let index = sampler.index(c.place);
            let n = units.map(|u| dot(c.normal, u));
            let length = n[0].hypot(n[1]);
            if length < 0.2 {
                continue;
            }
            let k = (index[slice_axis].round().max(0.0) as usize).min(feet.len() - 1);
            feet[k].push(Foot {
                at: [index[axes[0]] * spacing[0], index[axes[1]] * spacing[1]],
                normal: n.map(|v| v / length),
            });
            for i in 0..2 {
                low[i] = low[i].min(index[axes[i]]);
                high[i] = high[i].max(index[axes[i]]);
            }
        }
        if low[0] > high[0] {
            return None;
        }
        let low = low.map(|v| (v - 4.0).max(0.0) as usize);
        let shape = [0, 1].map(|i| ((high[i] + 5.0) as usize).min(sampler.shape[axes[i]] - 1) - low[i] + 1);
        let mut contours = Self {
            axes,
            low,
            shape,
            spacing,
            units,
            gaps: gaps.to_vec(),
            places: Vec::new(),
            distances: Vec::new(),
        };
        let widest = |k: usize| gaps[k.saturating_sub(1)].max(gaps[k.min(gaps.len() - 1)]);
        contours.distances = feet
            .par_iter()
            .enumerate()
            .panic_fuse()
            .map(|(k, feet)| contours.distances_to(sampler, feet, furthest(widest(k))))
            .collect();
        contours.places = feet.iter().map(|feet| feet.iter().map(|f| f.at).collect()).collect();
        Some(contours)
    }

    /// Distance from each pixel to the nearest foot no further than `furthest` mm, by two sweeps that
    /// hand on the nearest.
    fn distances_to(&self, sampler: &Sampler, feet: &[Foot], furthest: f64) -> Vec<f32> {
        let [rows, columns] = self.shape;
        let place = |r: usize, c: usize| {
            [(r + self.low[0]) as f64 * self.spacing[0], (c + self.low[1]) as f64 * self.spacing[1]]
        };
        let squared = |p: [f64; 2], foot: u32| {
            let q = feet[foot as usize].at;
            (p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2)
        };
        let mut nearest = vec![u32::MAX; rows * columns];
        let offer = |nearest: &mut [u32], r: usize, c: usize, foot: u32| {
            let old = nearest[r * columns + c];
            let p = place(r, c);
            let limit = if old == u32::MAX { furthest * furthest } else { squared(p, old) };
            if old != foot && squared(p, foot) < limit {
                nearest[r * columns + c] = foot;
            }
        };
        for (i, foot) in feet.iter().enumerate() {
            let at: [f64; 2] = [0, 1].map(|a| foot.at[a] / self.spacing[a] - self.low[a] as f64);
            for r in [at[0].floor(), at[0].ceil()] {
                for c in [at[1].floor(), at[1].ceil()] {
                    if r >= 0.0 && c >= 0.0 && (r as usize) < rows && (c as usize) < columns {
                        offer(&mut nearest, r as usize, c as usize, i as u32);
                    }
                }
            }
        }
        for _ in 0..2 {
            for r in 0..rows {
                sampler.ask();
                sweep(&mut nearest, columns, r, r.checked_sub(1), &offer);
            }
            for r in (0..rows).rev() {
                sampler.ask();
                sweep(&mut nearest, columns, r, (r + 1 < rows).then_some(r + 1), &offer);
            }
        }
        (0..rows * columns)
            .map(|i| {
                let Some(foot) = feet.get(nearest[i] as usize) else { return f32::NAN };
                let p = place(i / columns, i % columns);
                let v = [p[0] - foot.at[0], p[1] - foot.at[1]];
                let distance = v[0].hypot(v[1]);
                let across = v[0] * foot.normal[0] + v[1] * foot.normal[1];
                let pixel = self.spacing[0].max(self.spacing[1]);
                if distance < 1.5 * pixel {
                    across as f32
                } else if across.abs() < ACROSS * distance {
                    f32::NAN
                } else {
                    (distance * across.signum()) as f32
                }
            })
            .collect()
    }

    /// Whether the contours on both sides of a place tell where the skin is there.
    pub(crate) fn knows(&self, sampler: &Sampler, p: Vec3) -> bool {
        let index = sampler.index(p);
        let k = (index[sampler.slice_axis()].floor().max(0.0) as usize).min(self.distances.len() - 2);
        let at = [0, 1].map(|i| index[self.axes[i]].round() - self.low[i] as f64);
        if (0..2).any(|i| at[i] < 0.0 || at[i] as usize >= self.shape[i]) {
            return false;
        }
        let offset = at[0] as usize * self.shape[1] + at[1] as usize;
        let (a, b) = (self.distances[k][offset], self.distances[k + 1][offset]);
        let gap = dot(sampler.step_at(sampler.slice_axis(), k), sampler.slice_normal()).abs();
        a.is_finite() && b.is_finite() && (a < 0.0) != (b < 0.0) && shift(a, b) <= FLATTEST * gap
    }

    /// A crossing of a line across the slices that only one of them shows, where the contours of that slice and
    /// the next one behind it have the skin; `None` where they do not tell.
    pub(crate) fn cap(&self, sampler: &Sampler, c: &Crossing) -> Option<Crossing> {
        let axis = sampler.slice_axis();
        let mut index = sampler.index(c.place);
        let k = (index[axis].floor().max(0.0) as usize).min(self.gaps.len() - 1);
        let outward = dot(c.normal, sampler.slice_normal()) > 0.0;
        let (own, below, behind) =
            if outward { (k, k.checked_sub(1)?, k.checked_sub(1)?) } else { (k + 1, k + 2, k + 1) };
        let p = [0, 1].map(|i| index[self.axes[i]] * self.spacing[i]);
        let behind_mm = *self.gaps.get(behind)?;
        let rise = caps::rise(&self.places[own], self.places.get(below)?, behind_mm, p, self.gaps[k])?;
        index[axis] = own as f64 + if outward { rise.share } else { -rise.share };
        Some(Crossing { place: sampler.lps(index), error: rise.error.hypot(ROUNDNESS * self.gaps[k]), ..*c })
    }
}

/// Distances to a contour count no further than this, mm, for a gap between slices in mm.
fn furthest(gap: f64) -> f64 {
    8.0 + 2.0 * gap
}

/// How far the contour moves from one slice to the next, from the distances to both, mm.
fn shift(below: f32, above: f32) -> f64 {
    f64::from(above - below).abs()
}

/// One row takes over the nearest feet of the row before it and hands them on along itself.
fn sweep(
    nearest: &mut [u32],
    columns: usize,
    r: usize,
    from: Option<usize>,
    offer: &impl Fn(&mut [u32], usize, usize, u32),
) {
    let mut take = |c: usize, row: usize, column: usize| {
        let foot = nearest[row * columns + column];
        if foot != u32::MAX {
            offer(nearest, r, c, foot);
        }
    };
    for c in 0..columns {
        if let Some(from) = from {
            take(c, from, c);
            if c > 0 {
                take(c, from, c - 1);
            }
            if c + 1 < columns {
                take(c, from, c + 1);
            }
        }
        if c > 0 {
            take(c, r, c - 1);
        }
    }
    for c in (0..columns.saturating_sub(1)).rev() {
        take(c, r, c + 1);
    }
}
