//! The skin between two slices, where the distance to the contour is 0.

use super::{Contours, FLATTEST, furthest, shift};
use crate::geometry::{Plane, PlaneSet, Vec3, add, dot, normalised, scale};
use crate::pipeline::precise::border::crossing::Crossing;
use crate::pipeline::precise::grid::index::VoxelPlace;
use crate::pipeline::precise::scan::sampler::Sampler;

/// Images between two slices are made this far apart at most, mm.
const STEP_MM: f64 = 0.8;
/// The distance's rise across the slices is taken over twice this share of their gap.
const RISE: f64 = 0.05;

/// A level between slice `k` and the next.
#[derive(Debug, Clone, Copy)]
struct Level {
    k: usize,
    /// The share of the way from the one to the other.
    t: f64,
    /// Between the two, mm.
    gap: f64,
}

/// The line that a made point lies on.
#[derive(Debug, Clone, Copy)]
struct Way {
    /// 0 or 1 along that axis of the slice, 2 across the slices.
    along: usize,
    /// Whether it leads out of the skin as the index grows.
    outward: bool,
}

impl Contours {
    /// The skin between slices k and k + 1.
    pub(in crate::pipeline::precise) fn between(&self, sampler: &Sampler, k: usize) -> Vec<Crossing> {
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
                sampler.ask();
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
                        if let Some(made_here) = self.point(
                            sampler,
                            Level { k, t, gap },
                            place,
                            Way { along, outward: here < 0.0 },
                        ) {
                            made.push(made_here);
                        }
                    }
                }
            }
        }
        // The lines across the slices.
        for i in 0..rows * columns {
            sampler.ask_at(i);
            let (a, b) = (below[i], above[i]);
            if known(i) && (a < 0.0) != (b < 0.0) && steep(i) {
                let t = self.zero(k, i);
                let place = [(i / columns) as f64, (i % columns) as f64];
                if let Some(made_here) =
                    self.point(sampler, Level { k, t, gap }, place, Way { along: 2, outward: a < 0.0 })
                {
                    made.push(made_here);
                }
            }
        }
        made
    }

    /// A point of skin at `place` (row and column, from `low`) of a level.
    fn point(&self, sampler: &Sampler, level: Level, place: [f64; 2], way: Way) -> Option<Crossing> {
        let (Level { k, t, gap }, Way { along, outward }) = (level, way);
        let slice_axis = sampler.slice_axis();
        let mut index = VoxelPlace([0.0; 3]);
        index[slice_axis] = k as f64 + t;
        index[self.axes[0]] = place[0] + self.low[0] as f64;
        index[self.axes[1]] = place[1] + self.low[1] as f64;
        let normal = self.normal(sampler, level, place)?;
        let nearest = place[0].round() as usize * self.shape[1] + place[1].round() as usize;
        let shift = shift(self.distances[k][nearest], self.distances[k + 1][nearest]);
        let axis = if along == 2 { slice_axis } else { self.axes[along] };
        // At a sharp edge the mean of the distances around may turn away from the line.
        let leading = dot(normal, sampler.mean_step(axis));
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
            place: sampler.lps(index),
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
    fn normal(&self, sampler: &Sampler, level: Level, place: [f64; 2]) -> Option<Vec3> {
        let Level { k, t, gap } = level;
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
        normalised(add(in_slice, scale(sampler.slice_normal(), rise)))
    }
}
