//! How well the lines of all three directions agree about the skin around a point.

use std::ops::Range;

use rayon::prelude::*;

use crate::geometry::{Vec3, add, cross, dot, normalised, scale, sub};
use crate::observer::stop::Asked;
use crate::pipeline::precise::border::crossing::Crossing;
use crate::pipeline::precise::grid::cubes::Cubes;

/// How far around a point its neighbours are taken, mm.
const REACH_MM: f64 = 2.0;
/// Neighbours nearly in a row tell no slope across it: least determinant of their spread, of its
/// trace squared.
const LEAST_SPREAD: f64 = 0.01;
/// With fewer neighbours nothing can be said.
const LEAST: usize = 8;

/// What the crossings around a point say about it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Agreement {
    /// Where the skin is at the point according to its neighbours: outward from it, mm.
    pub(crate) offset: f64,
    /// Scatter of the neighbours about their common surface, mm.
    pub(crate) scatter: f64,
    /// Mean curvature of that surface, 1/mm; positive where it bulges outward.
    pub(crate) curvature: f64,
    /// Its outward unit normal at the point, which hundreds of places tell better than the noisy
    /// voxels next to it; the point's own without enough neighbours.
    pub(crate) normal: Vec3,
    /// How many neighbours there were.
    neighbours: usize,
}

impl Agreement {
    /// Whether there were enough neighbours to say anything.
    pub(crate) fn is_known(&self) -> bool {
        self.neighbours >= LEAST
    }
}

/// All crossings, by place.
#[derive(Debug)]
pub(crate) struct Neighbourhood<'a> {
    crossings: &'a [Crossing],
    /// Of the reach's edge.
    cubes: Cubes,
    /// Where the members of the cubes around each are.
    around: Vec<[Range<usize>; 9]>,
    /// Place and outward normal of each crossing, cube after cube.
    members: Vec<[f32; 6]>,
}

impl<'a> Neighbourhood<'a> {
    /// Sorts the crossings into cubes.
    pub(crate) fn of(asked: Asked<'_>, crossings: &'a [Crossing]) -> Self {
        let cubes = Cubes::of(asked, crossings.par_iter().map(|c| c.place), REACH_MM);
        let member = |(_, i): &(u64, u32)| {
            asked.ask_at(*i as usize);
            let c = &crossings[*i as usize];
            let ([x, y, z], [nx, ny, nz]) = (c.place, c.normal);
            [x, y, z, nx, ny, nz].map(|v| v as f32)
        };
        let members = cubes.sorted().par_iter().panic_fuse().map(member).collect();
        Self { crossings, around: cubes.around(asked), cubes, members }
    }

    /// Drops it, asking.
    pub(crate) fn free(self, asked: Asked<'_>) {
        asked.free(self.members);
        self.cubes.free(asked);
    }

    /// The neighbours of a crossing that face the same way, as steps from it, mm; and the sum of their
    /// normals.
    fn near(&self, crossing: usize) -> (Vec<[f32; 3]>, [f32; 3]) {
        let Crossing { place, normal, .. } = self.crossings[crossing];
        let (at, facing) = (place.map(|v| v as f32), normal.map(|v| v as f32));
        let reach = (REACH_MM * REACH_MM) as f32;
        let mut near: Vec<[f32; 3]> = Vec::with_capacity(256);
        let mut sum = [0f32; 3];
        for row in self.around[self.cubes.cube(crossing)].clone() {
            for m in &self.members[row] {
                let d = [m[0] - at[0], m[1] - at[1], m[2] - at[2]];
                let squared = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                let cosine = m[3] * facing[0] + m[4] * facing[1] + m[5] * facing[2];
                if squared <= reach && cosine > 0.5 {
                    near.push(d);
                    (0..3).for_each(|a| sum[a] += m[3 + a]);
                }
            }
        }
        (near, sum)
    }

    /// What the neighbours of a crossing say about it: the height of the common surface over its
    /// tangent plane is fitted by a + b·d² in the distance d from the point.
    pub(crate) fn agreement(&self, crossing: usize) -> Agreement {
        let own = self.crossings[crossing].normal;
        let (near, normal) = self.near(crossing);
        let n = near.len();
        if n < LEAST {
            return Agreement { normal: own, neighbours: n, ..Agreement::default() };
        }
        let normal = normalised(normal.map(f64::from)).unwrap_or(own);
        let count = n as f64;
        let (mut mq, mut mh) = (0.0, 0.0);
        let tangent = tangents(normal);
        let mut heights: Vec<[f64; 4]> = Vec::with_capacity(n);
        for d in &near {
            let d = d.map(f64::from);
            let h = dot(d, normal);
            let q = dot(d, d) - h * h;
            mq += q;
            mh += h;
            heights.push([q, h, dot(d, tangent[0]), dot(d, tangent[1])]);
        }
        mq /= count;
        mh /= count;
        let (mut spread, mut common) = (0.0, 0.0);
        for [q, h, ..] in &heights {
            spread += (q - mq).powi(2);
            common += (q - mq) * (h - mh);
        }
        let slope = if spread > 1e-6 * count { common / spread } else { 0.0 };
        let offset = mh - slope * mq;
        let mut squared = 0.0;
        let (mut uu, mut uv, mut vv, mut ur, mut vr) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for [q, h, u, v] in heights {
            let residual = h - offset - slope * q;
            squared += residual * residual;
            uu += u * u;
            uv += u * v;
            vv += v * v;
            ur += u * residual;
            vr += v * residual;
        }
        let scatter = (squared / count).sqrt();
        // The slope of what is left over.
        let area = uu * vv - uv * uv;
        let rise = if area > LEAST_SPREAD * (uu + vv).powi(2) {
            [(vv * ur - uv * vr) / area, (uu * vr - uv * ur) / area]
        } else {
            [0.0; 2]
        };
        let tilted = sub(normal, add(scale(tangent[0], rise[0]), scale(tangent[1], rise[1])));
        let normal = normalised(tilted).filter(|n| dot(*n, own) > 0.0).unwrap_or(own);
        Agreement { offset, scatter, curvature: -2.0 * slope, normal, neighbours: n }
    }
}

/// Two unit vectors at right angles to `n` and each other.
fn tangents(n: Vec3) -> [Vec3; 2] {
    let least = (0..3).min_by(|&a, &b| n[a].abs().total_cmp(&n[b].abs())).unwrap_or(0);
    let mut axis = [0.0; 3];
    axis[least] = 1.0;
    let u = normalised(cross(n, axis)).unwrap_or([0.0; 3]);
    [u, cross(n, u)]
}
