//! The contours of the slices as distances, and the skin that they tell of between two of them.

use rayon::prelude::*;

use super::caps::{self, Place};
use super::crossings::Crossing;
use super::space::Space;
use crate::geometry::{Plane, PlaneSet, Vec3, add, dot, norm, normalised, scale};

/// Images between two slices are made this far apart at most, mm.
const STEP_MM: f64 = 0.8;
/// Where the contour moves further than so many gaps from one slice to the next, nobody can tell
/// how: the tip of an ear ends somewhere between.
const FLATTEST: f64 = 4.0;
/// A distance is trusted only if its foot lies across the contour, not beyond its end: the least
/// cosine.
const ACROSS: f64 = 0.8;

/// The bends on both sides of a gap agree up to this ratio; the larger counts no more.
const BEND_RATIO: f64 = 3.0;
/// A contour's way from slice to slice changes by this share of it at most, where one side tells.
const MOST_BENT: f64 = 0.6;
/// And by what so small a radius makes of it, mm.
const LEAST_RADIUS_MM: f64 = 30.0;
/// The distance's rise across the slices is taken over twice this share of their gap.
const RISE: f64 = 0.05;

/// A point of a slice's contour: place and normal in the slice, mm.
#[derive(Debug, Clone, Copy)]
struct Foot {
    at: Place,
    normal: [f64; 2],
}

/// The signed distance to the contour of every slice, mm, in the part of the slices that the skin
/// takes; NaN where it is not known.
#[derive(Debug)]
pub(super) struct Contours {
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
    pub(super) fn of(space: &Space, gaps: &[f64], crossings: &[Crossing]) -> Option<Self> {
        let slice_axis = space.slice_axis();
        let axes: [usize; 2] = match slice_axis {
            0 => [1, 2],
            1 => [0, 2],
            _ => [0, 1],
        };
        let spacing = axes.map(|a| norm(space.mean_step(a)));
        let units = [0, 1].map(|i| scale(space.mean_step(axes[i]), 1.0 / spacing[i]));
        let mut feet: Vec<Vec<Foot>> = vec![Vec::new(); space.shape[slice_axis]];
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        for c in crossings.iter().filter(|c| usize::from(c.axis) != slice_axis) {
            let index = space.index(c.place);
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
        let shape = [0, 1].map(|i| ((high[i] + 5.0) as usize).min(space.shape[axes[i]] - 1) - low[i] + 1);
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
            .map(|(k, feet)| contours.distances_to(feet, furthest(widest(k))))
            .collect();
        contours.places = feet.iter().map(|feet| feet.iter().map(|f| f.at).collect()).collect();
        Some(contours)
    }

    /// Distance from each pixel to the nearest foot no further than `furthest` mm, by two sweeps that
    /// hand on the nearest.
    fn distances_to(&self, feet: &[Foot], furthest: f64) -> Vec<f32> {
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
                sweep(&mut nearest, columns, r, r.checked_sub(1), &offer);
            }
            for r in (0..rows).rev() {
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
    pub(super) fn knows(&self, space: &Space, p: Vec3) -> bool {
        let index = space.index(p);
        let k = (index[space.slice_axis()].floor().max(0.0) as usize).min(self.distances.len() - 2);
        let at = [0, 1].map(|i| index[self.axes[i]].round() - self.low[i] as f64);
        if (0..2).any(|i| at[i] < 0.0 || at[i] as usize >= self.shape[i]) {
            return false;
        }
        let offset = at[0] as usize * self.shape[1] + at[1] as usize;
        let (a, b) = (self.distances[k][offset], self.distances[k + 1][offset]);
        let gap = dot(space.step_at(space.slice_axis(), k), space.slice_normal()).abs();
        a.is_finite() && b.is_finite() && (a < 0.0) != (b < 0.0) && shift(a, b) <= FLATTEST * gap
    }

    /// How high the skin rises over the slice that is the last to show it, at a crossing of a line across the
    /// slices.
    pub(super) fn cap(&self, space: &Space, c: &Crossing) -> Option<Crossing> {
        let axis = space.slice_axis();
        let mut index = space.index(c.place);
        let k = (index[axis].floor().max(0.0) as usize).min(self.gaps.len() - 1);
        let outward = dot(c.normal, space.slice_normal()) > 0.0;
        let (own, below, behind) =
            if outward { (k, k.checked_sub(1)?, k.checked_sub(1)?) } else { (k + 1, k + 2, k + 1) };
        let p = [0, 1].map(|i| index[self.axes[i]] * self.spacing[i]);
        let behind_mm = *self.gaps.get(behind)?;
        let rise = caps::rise(&self.places[own], self.places.get(below)?, behind_mm, p, self.gaps[k])?;
        index[axis] = own as f64 + if outward { rise.share } else { -rise.share };
        Some(Crossing { place: space.lps(index), error: rise.error, ..*c })
    }

    /// The skin between slices k and k + 1.
    pub(super) fn between(&self, space: &Space, k: usize) -> Vec<Crossing> {
        let gap = self.gaps[k];
        let (below, above) = (&self.distances[k], &self.distances[k + 1]);
        let [rows, columns] = self.shape;
        let furthest = furthest(gap) as f32;
        let known = |i: usize| below[i].abs() < furthest && above[i].abs() < furthest;
        let steep = |i: usize| shift(below[i], above[i]) <= FLATTEST * gap;
        let mut made = Vec::new();
        let parts = (gap / STEP_MM).ceil() as usize;
        for part in 1..parts {
            let t = part as f64 / parts as f64;
            let at = |i: usize| self.distance(k, t, i);
            for r in 0..rows {
                for c in 0..columns {
                    let i = r * columns + c;
                    if !known(i) {
                        continue;
                    }
                    let here = at(i);
                    for (along, j) in
                        [(1, (c + 1 < columns).then_some(i + 1)), (0, (r + 1 < rows).then_some(i + columns))]
                    {
                        let Some(j) = j.filter(|&j| known(j)) else { continue };
                        let there = at(j);
                        if (here < 0.0) == (there < 0.0) || !steep(i) || !steep(j) {
                            continue;
                        }
                        let mut place = [r as f64, c as f64];
                        place[along] += here / (here - there);
                        if let Some(made_here) = self.point(space, k, t, gap, place, (along, here < 0.0)) {
                            made.push(made_here);
                        }
                    }
                }
            }
        }
        // The lines across the slices.
        for i in 0..rows * columns {
            let (a, b) = (below[i], above[i]);
            if known(i) && (a < 0.0) != (b < 0.0) && steep(i) {
                let t = self.zero(k, i);
                let place = [(i / columns) as f64, (i % columns) as f64];
                if let Some(made_here) = self.point(space, k, t, gap, place, (2, a < 0.0)) {
                    made.push(made_here);
                }
            }
        }
        made
    }

    /// The distance to the contour at pixel `i`, the share `t` of the way from slice k to k + 1, mm. The
    /// straight line between the two would cut off what is curved: the next slices on both sides
    /// tell how much, as far as they agree.
    fn distance(&self, k: usize, t: f64, i: usize) -> f64 {
        let (below, above) = (f64::from(self.distances[k][i]), f64::from(self.distances[k + 1][i]));
        let straight = below * (1.0 - t) + above * t;
        let gap = self.gaps[k];
        straight - t * (1.0 - t) * gap * gap * self.bend(k, t, i)
    }

    /// Half the second derivative of the distance across the slices, per mm.
    fn bend(&self, k: usize, t: f64, i: usize) -> f64 {
        let lower = k.checked_sub(1).map_or(f64::NAN, |k| self.second_difference(k, i));
        let upper = if k + 2 < self.distances.len() { self.second_difference(k, i) } else { f64::NAN };
        match (lower.is_finite(), upper.is_finite()) {
            (true, true) if lower * upper > 0.0 => {
                let limit = BEND_RATIO * lower.abs().min(upper.abs());
                let (lower, upper) = (lower.clamp(-limit, limit), upper.clamp(-limit, limit));
                (lower * (2.0 - t) + upper * (1.0 + t)) / 3.0
            }
            (true, false) => self.credible(k, i, lower),
            (false, true) => self.credible(k, i, upper),
            _ => 0.0,
        }
    }

    /// As much of a bend that only one side tells as a round head can have: where the skin is steep it is
    /// little, and grows with the way that the contour moves.
    fn credible(&self, k: usize, i: usize, bend: f64) -> f64 {
        let moved = shift(self.distances[k][i], self.distances[k + 1][i]) / self.gaps[k].powi(2);
        let limit = 0.5 * (MOST_BENT * moved + 1.0 / LEAST_RADIUS_MM);
        bend.clamp(-limit, limit)
    }

    /// The second divided difference of the distances in slices k, k + 1, k + 2, per mm; NaN where one
    /// of them does not know it.
    fn second_difference(&self, k: usize, i: usize) -> f64 {
        let d = |k: usize| f64::from(self.distances[k][i]);
        let (first, second) = (self.gaps[k], self.gaps[k + 1]);
        ((d(k + 2) - d(k + 1)) / second - (d(k + 1) - d(k)) / first) / (first + second)
    }

    /// Where the distance at pixel `i` is 0, as a share of the way from slice k to k + 1.
    fn zero(&self, k: usize, i: usize) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        let inside = self.distances[k][i] < 0.0;
        for _ in 0..20 {
            let middle = 0.5 * (low + high);
            if (self.distance(k, middle, i) < 0.0) == inside {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }

    /// A point of skin at `place` (row and column, from `low`), the share `t` of the way from
    /// slice k to k + 1, on a line along 0 or 1 in the slice or 2 across, that leads out of the skin or into
    /// it.
    fn point(
        &self,
        space: &Space,
        k: usize,
        t: f64,
        gap: f64,
        place: [f64; 2],
        (along, outward): (usize, bool),
    ) -> Option<Crossing> {
        let slice_axis = space.slice_axis();
        let mut index = [0.0; 3];
        index[slice_axis] = k as f64 + t;
        index[self.axes[0]] = place[0] + self.low[0] as f64;
        index[self.axes[1]] = place[1] + self.low[1] as f64;
        let normal = self.normal(space, k, t, gap, place)?;
        let nearest = place[0].round() as usize * self.shape[1] + place[1].round() as usize;
        let shift = shift(self.distances[k][nearest], self.distances[k + 1][nearest]);
        let axis = if along == 2 { slice_axis } else { self.axes[along] };
        // At a sharp edge the mean of the distances around may turn away from the line.
        let leading = dot(normal, space.mean_step(axis));
        if leading == 0.0 || (leading > 0.0) != outward {
            return None;
        }
        // A made line lies in no slice of the acquired plane.
        let own = [Plane::Axial, Plane::Coronal, Plane::Sagittal][slice_axis];
        let planes = match axis {
            2 => [Plane::Axial, Plane::Coronal],
            1 => [Plane::Axial, Plane::Sagittal],
            _ => [Plane::Sagittal, Plane::Coronal],
        };
        let planes =
            planes.into_iter().filter(|&p| p != own).fold(PlaneSet::EMPTY, |set, p| set.union(p.into()));
        Some(Crossing {
            place: space.lps(index),
            normal,
            planes,
            axis: axis as u8,
            between: true,
            coarseness: shift / gap,
            error: 0.02 * gap + 0.02,
            level: 0.0,
        })
    }

    /// Outward normal: the gradient of the interpolated distance.
    fn normal(&self, space: &Space, k: usize, t: f64, gap: f64, place: [f64; 2]) -> Option<Vec3> {
        let [rows, columns] = self.shape;
        let (r, c) = (place[0].round() as usize, place[1].round() as usize);
        if r == 0 || c == 0 || r + 1 >= rows || c + 1 >= columns {
            return None;
        }
        let i = r * columns + c;
        let at = |i: usize| self.distance(k, t, i);
        let g = [
            (at(i + columns) - at(i - columns)) / (2.0 * self.spacing[0]),
            (at(i + 1) - at(i - 1)) / (2.0 * self.spacing[1]),
        ];
        let rise = (self.distance(k, t + RISE, i) - self.distance(k, t - RISE, i)) / (2.0 * RISE * gap);
        let in_slice = add(scale(self.units[0], g[0]), scale(self.units[1], g[1]));
        normalised(add(in_slice, scale(space.slice_normal(), rise)))
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
