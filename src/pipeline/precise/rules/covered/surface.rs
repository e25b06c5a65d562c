//! The skin as a mesh of nodes, coarse enough that all of it can be searched along the skin.

use std::cmp::Ordering;

use rayon::prelude::*;

use crate::geometry::{Vec3, add, dot, norm, normalised, scale, sub};
use crate::observer::stop::Asked;
use crate::pipeline::precise::border::crossing::Crossing;
use crate::pipeline::precise::grid::cubes::{Cubes, groups, key, sorted};

/// Nodes are linked with those no further away than so many leaves.
const REACH: f64 = 2.4;
/// Nor with what lies behind them on a thin part: least cosine between two linked normals.
const FACING: f64 = -0.2;

/// Sine of a link's rise over the skin at large from which it is a ledge.
const LEDGE: f32 = 0.3;
/// Times that normals are smoothed: a ledge stands on the skin of some 10 leaves around.
const SMOOTHED: usize = 30;

/// Nodes, one for each leaf with crossings, and the links between those beside each other.
#[derive(Debug)]
pub(crate) struct Surface<'a> {
    /// Whom the searches over it ask.
    pub(crate) asked: Asked<'a>,
    /// Edge of a leaf, mm.
    pub(crate) leaf: f64,
    /// The leaf of each node, as [`key`] names it; ascending.
    pub(crate) leaves: Vec<u64>,
    /// LPS mm.
    pub(crate) places: Vec<Vec3>,
    /// Outward unit normals.
    pub(crate) normals: Vec<[f32; 3]>,
    /// Where the links of each node begin, and where those of the last end.
    starts: Vec<u32>,
    /// The ends of all links.
    ends: Vec<u32>,
    /// How all links rise.
    rises: Vec<f32>,
}

/// The links across the gap between two slices, and those of them that are ledges, upward or downward.
#[derive(Debug, Clone, Copy, Default)]
struct Step {
    links: f64,
    up: f64,
    down: f64,
}

/// A link with so much of its length across the slices leads across them.
const ACROSS: f64 = 0.5;
/// Least share of ledges, up as well as down, where the patient moved.
const MOVED: f64 = 0.08;

impl Step {
    fn is_of_motion(&self) -> bool {
        self.up.min(self.down) > MOVED * self.links
    }
}

/// A link from one node to another.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Link {
    /// The other node.
    pub(crate) to: usize,
    /// How steeply it rises over the skin at large: the sine of the angle, positive where the other
    /// node lies further out.
    pub(crate) rise: f32,
}

impl Link {
    /// Whether it rises or falls like a ledge.
    pub(crate) fn is_ledge(self) -> bool {
        self.rise.abs() > LEDGE
    }
}

impl<'a> Surface<'a> {
    /// The mesh of all crossings with leaves of edge `leaf` mm.
    pub(crate) fn of(asked: Asked<'a>, crossings: &[Crossing], leaf: f64) -> Self {
        let keyed = |(i, c): (usize, &Crossing)| (key(c.place, leaf), i as u32);
        let by_leaf = sorted(asked, crossings.par_iter().enumerate().map(keyed));
        let groups = groups(asked, &by_leaf);
        let (places, normals): (Vec<Vec3>, Vec<Vec3>) =
            groups.par_iter().panic_fuse().map(|group| mean(asked, crossings, group)).unzip();
        let leaves = groups.iter().map(|group| group[0].0).collect();
        let linked = linked(asked, &places, &normals, REACH * leaf);
        let mut starts = Vec::with_capacity(linked.len() + 1);
        let mut count = 0;
        for links in &linked {
            starts.push(count);
            count += links.len() as u32;
        }
        starts.push(count);
        let normals = normals.into_iter().map(|n| n.map(|v| v as f32)).collect();
        let ends = linked.concat();
        let mut surface = Self { asked, leaf, leaves, places, normals, starts, ends, rises: Vec::new() };
        surface.rises = surface.rises_over(&surface.smooth());
        surface
    }

    /// Takes the ledges between slices back that tell nothing: where these lie further apart than
    /// `widest` mm a ledge is no steeper than other skin, and a patient who moved stands out on one
    /// side as far as he stands back on the other. `gaps` are those between the slices in mm, `slice`
    /// tells where a node lies, in slices.
    pub(crate) fn level_between_slices(
        &mut self,
        gaps: &[f64],
        widest: f64,
        slice: impl Fn(Vec3) -> f64 + Sync,
    ) {
        let at: Vec<f64> = self.places.par_iter().map(|p| slice(*p)).collect();
        let gap = |v: f64| (v.max(0.0) as usize).min(gaps.len() - 1);
        let mut steps = vec![Step::default(); gaps.len()];
        let mut across = Vec::with_capacity(self.ends.len());
        for node in 0..self.len() {
            self.asked.ask_at(node);
            for link in self.links(node) {
                let (low, high) = (at[node].min(at[link.to]), at[node].max(at[link.to]));
                let way = norm(sub(self.places[link.to], self.places[node]));
                if (high - low) * gaps[gap(low)] < ACROSS * way {
                    across.push(None);
                    continue;
                }
                across.push(Some((gap(low), gap(high))));
                let rise = link.rise * (at[link.to] - at[node]).signum() as f32;
                for step in &mut steps[gap(low)..=gap(high)] {
                    step.links += 1.0;
                    step.up += f64::from(u8::from(rise > LEDGE));
                    step.down += f64::from(u8::from(rise < -LEDGE));
                }
            }
        }
        let level: Vec<bool> =
            steps.iter().zip(gaps).map(|(s, gap)| s.is_of_motion() || *gap > widest).collect();
        for (rise, gaps) in self.rises.iter_mut().zip(across) {
            if gaps.is_some_and(|(low, high): (usize, usize)| level[low..=high].contains(&true)) {
                *rise = 0.0;
            }
        }
    }

    /// Number of nodes.
    pub(crate) fn len(&self) -> usize {
        self.places.len()
    }

    /// How many nodes an area has, mm².
    pub(crate) fn nodes_of(&self, area: f64) -> usize {
        (area / (self.leaf * self.leaf)) as usize
    }

    /// Diagonal of the box around some nodes, mm.
    pub(crate) fn extent(&self, nodes: &[usize]) -> f64 {
        let (mut low, mut high): (Vec3, Vec3) = ([f64::MAX; 3], [f64::MIN; 3]);
        for &node in nodes {
            for a in 0..3 {
                low[a] = low[a].min(self.places[node][a]);
                high[a] = high[a].max(self.places[node][a]);
            }
        }
        norm(sub(high, low))
    }

    /// Takes the ledges at some nodes back.
    pub(crate) fn level_at(&mut self, nodes: &[usize]) {
        let mut at = vec![false; self.len()];
        nodes.iter().for_each(|&node| at[node] = true);
        for node in 0..self.len() {
            self.asked.ask_at(node);
            for link in self.starts[node] as usize..self.starts[node + 1] as usize {
                if at[node] || at[self.ends[link] as usize] {
                    self.rises[link] = 0.0;
                }
            }
        }
    }

    /// Some nodes and those a few links away.
    pub(crate) fn beyond(&self, mut all: Vec<usize>, links: usize) -> Vec<usize> {
        let mut is_in = vec![false; self.len()];
        all.iter().for_each(|&node| is_in[node] = true);
        let mut from = 0;
        for _ in 0..links {
            let to = all.len();
            for i in from..to {
                self.asked.ask_at(i);
                for link in self.links(all[i]) {
                    if !std::mem::replace(&mut is_in[link.to], true) {
                        all.push(link.to);
                    }
                }
            }
            from = to;
        }
        all
    }

    /// The links of a node.
    pub(crate) fn links(&self, node: usize) -> impl Iterator<Item = Link> {
        let range = self.starts[node] as usize..self.starts[node + 1] as usize;
        let (ends, rises) = (&self.ends[range.clone()], &self.rises[range]);
        ends.iter().zip(rises).map(|(&to, &rise)| Link { to: to as usize, rise })
    }

    /// What hangs together of the nodes that are `within` by links from them that are `whole`: the part
    /// of each node, `u32::MAX` without, and the nodes of each part.
    pub(crate) fn parts(
        &self,
        within: impl Fn(usize) -> bool,
        whole: impl Fn(usize, Link) -> bool,
    ) -> (Vec<u32>, Vec<Vec<usize>>) {
        let mut part_of = vec![u32::MAX; self.len()];
        let mut parts = Vec::new();
        for first in 0..self.len() {
            self.asked.ask_at(first);
            if part_of[first] != u32::MAX || !within(first) {
                continue;
            }
            let part = parts.len() as u32;
            part_of[first] = part;
            let mut nodes = vec![first];
            let mut next = 0;
            while next < nodes.len() {
                let node = nodes[next];
                next += 1;
                self.asked.ask_at(next);
                for link in self.links(node) {
                    if part_of[link.to] == u32::MAX && within(link.to) && whole(node, link) {
                        part_of[link.to] = part;
                        nodes.push(link.to);
                    }
                }
            }
            parts.push(nodes);
        }
        (part_of, parts)
    }

    /// The normals of the skin at large.
    fn smooth(&self) -> Vec<[f32; 3]> {
        let mut smooth = self.normals.clone();
        for _ in 0..SMOOTHED {
            self.asked.ask();
            let of_node = |node: usize| {
                self.asked.ask_at(node);
                let mut sum = smooth[node];
                for &other in &self.ends[self.starts[node] as usize..self.starts[node + 1] as usize] {
                    (0..3).for_each(|a| sum[a] += smooth[other as usize][a]);
                }
                let length = (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]).sqrt().max(1e-6);
                sum.map(|v| v / length)
            };
            smooth = (0..self.len()).into_par_iter().panic_fuse().map(of_node).collect();
        }
        smooth
    }

    fn rises_over(&self, smooth: &[[f32; 3]]) -> Vec<f32> {
        let of_node = |node: usize| {
            self.asked.ask_at(node);
            self.ends[self.starts[node] as usize..self.starts[node + 1] as usize].iter().map(move |&other| {
                let other = other as usize;
                let step = sub(self.places[other], self.places[node]);
                let up = add(smooth[node].map(f64::from), smooth[other].map(f64::from));
                normalised(up).map_or(0.0, |up| (dot(step, up) / norm(step)) as f32)
            })
        };
        (0..self.len()).into_par_iter().panic_fuse().flat_map_iter(of_node).collect()
    }
}

/// Place and normal of a leaf, those that see the edge most clearly first.
fn mean(asked: Asked<'_>, crossings: &[Crossing], group: &[(u64, u32)]) -> (Vec3, Vec3) {
    asked.ask_at(group[0].1 as usize);
    let (mut place, mut normal, mut total) = ([0.0; 3], [0.0; 3], 0.0);
    for c in group.iter().map(|g| &crossings[g.1 as usize]) {
        let weight = 1.0 / (c.error * c.error);
        place = add(place, scale(c.place, weight));
        normal = add(normal, scale(c.normal, weight));
        total += weight;
    }
    (scale(place, 1.0 / total), normalised(normal).unwrap_or(crossings[group[0].1 as usize].normal))
}

/// For each place those within reach on the same side.
fn linked(asked: Asked<'_>, places: &[Vec3], normals: &[Vec3], reach: f64) -> Vec<Vec<u32>> {
    let cubes = Cubes::of(asked, places.par_iter().copied(), reach);
    let around = cubes.around(asked);
    let near = |i: usize| {
        asked.ask_at(i);
        let mut found = Vec::with_capacity(24);
        for row in around[cubes.cube(i)].clone() {
            found.extend(cubes.sorted()[row].iter().map(|member| member.1).filter(|&j| {
                let d = sub(places[j as usize], places[i]);
                let squared = dot(d, d);
                squared <= reach * reach
                    && squared.partial_cmp(&0.0) == Some(Ordering::Greater)
                    && dot(normals[i], normals[j as usize]) > FACING
            }));
        }
        found
    };
    (0..places.len()).into_par_iter().panic_fuse().map(near).collect()
}
