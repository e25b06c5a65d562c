//! How well the lines of all three directions agree about the skin around a point.

use std::collections::HashMap;

use rayon::prelude::*;

use super::crossings::Crossing;
use crate::geometry::{Vec3, dot, normalised, sub};

/// How far around a point its neighbours are taken, mm.
const REACH_MM: f64 = 2.0;
/// With fewer neighbours nothing can be said.
const LEAST: usize = 8;

/// What the crossings around a point say about it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Agreement {
    /// Where the skin is at the point according to its neighbours: outward from it, mm.
    pub(super) offset: f64,
    /// Scatter of the neighbours about their common surface, mm.
    pub(super) scatter: f64,
    /// Mean curvature of that surface, 1/mm; positive where it bulges outward.
    pub(super) curvature: f64,
    /// How many neighbours there were.
    neighbours: usize,
}

impl Agreement {
    /// Whether there were enough neighbours to say anything.
    pub(super) fn is_known(&self) -> bool {
        self.neighbours >= LEAST
    }
}

/// All crossings, by place.
#[derive(Debug)]
pub(super) struct Neighbourhood<'a> {
    crossings: &'a [Crossing],
    cells: HashMap<[i32; 3], (u32, u32)>,
    order: Vec<u32>,
}

impl<'a> Neighbourhood<'a> {
    /// Sorts the crossings into cells.
    #[expect(clippy::cast_possible_truncation)]
    pub(super) fn of(crossings: &'a [Crossing]) -> Self {
        let mut keyed: Vec<([i32; 3], u32)> =
            crossings.iter().enumerate().map(|(i, c)| (cell(c.place), i as u32)).collect();
        keyed.par_sort_unstable();
        let mut cells = HashMap::new();
        let mut start = 0;
        for group in keyed.chunk_by(|a, b| a.0 == b.0) {
            let end = start + group.len() as u32;
            cells.insert(group[0].0, (start, end));
            start = end;
        }
        Self { crossings, cells, order: keyed.into_iter().map(|k| k.1).collect() }
    }

    /// The crossings within reach of a point that face the same way.
    fn around(&self, c: &Crossing) -> impl Iterator<Item = &'a Crossing> {
        let centre = cell(c.place);
        let c = *c;
        (0..27)
            .filter_map(move |i| {
                let key = [0, 1, 2].map(|a| centre[a] + [i % 3, i / 3 % 3, i / 9][a] - 1);
                self.cells.get(&key)
            })
            .flat_map(|&(start, end)| &self.order[start as usize..end as usize])
            .map(|&i| &self.crossings[i as usize])
            .filter(move |o| {
                let d = sub(o.place, c.place);
                dot(d, d) <= REACH_MM * REACH_MM && dot(o.normal, c.normal) > 0.5
            })
    }

    /// What the neighbours of a point say about it: the height of the common surface over its
    /// tangent plane is fitted by a + b·d² in the distance d from the point.
    #[expect(clippy::cast_precision_loss)]
    pub(super) fn agreement(&self, c: &Crossing) -> Agreement {
        let neighbours: Vec<&Crossing> = self.around(c).collect();
        let n = neighbours.len();
        if n < LEAST {
            return Agreement { neighbours: n, ..Agreement::default() };
        }
        let mut normal = [0.0; 3];
        for o in &neighbours {
            for a in 0..3 {
                normal[a] += o.normal[a];
            }
        }
        let normal = normalised(normal).unwrap_or(c.normal);
        let heights: Vec<(f64, f64)> = neighbours
            .iter()
            .map(|o| {
                let d = sub(o.place, c.place);
                let h = dot(d, normal);
                (dot(d, d) - h * h, h)
            })
            .collect();
        let count = n as f64;
        let mean = |f: &dyn Fn(&(f64, f64)) -> f64| heights.iter().map(f).sum::<f64>() / count;
        let (mq, mh) = (mean(&|v| v.0), mean(&|v| v.1));
        let spread = mean(&|v| (v.0 - mq).powi(2));
        let slope = if spread > 1e-6 { mean(&|v| (v.0 - mq) * (v.1 - mh)) / spread } else { 0.0 };
        let offset = mh - slope * mq;
        let scatter = mean(&|v| (v.1 - offset - slope * v.0).powi(2)).sqrt();
        Agreement { offset, scatter, curvature: -2.0 * slope, neighbours: n }
    }
}

#[expect(clippy::cast_possible_truncation)]
fn cell(p: Vec3) -> [i32; 3] {
    p.map(|v| (v / REACH_MM).floor() as i32)
}
