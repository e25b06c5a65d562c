//! What flows along the skin from the ledges' upper to their lower sides.
//!
//! Every link of the mesh that is a ledge is a source above and a sink below, every other one
//! conducts, and a little is lost everywhere: the fill is the potential `φ` of `(D − W + λ) φ = s`,
//! in links at a node.

use rayon::prelude::*;

use super::surface::Surface;
use crate::geometry::{Vec3, add, dot, scale, sub};
use crate::pipeline::precise::grid::cubes::key;

/// How far what flows from a source gets before it is lost, mm.
const LOST_MM: f64 = 40.0;
/// Roughly, nodes that hang together within a cube of so many leaves fill alike.
const CUBE: f64 = 4.0;
/// Sweeps over all nodes that then smooth the cubes' edges.
const SWEEPS: usize = 12;

/// The fill of each node, roughly: an eighth of the work.
pub(crate) fn rough(surface: &Surface) -> Vec<f64> {
    let cube: Vec<u64> = surface.places.iter().map(|p| key(*p, CUBE * surface.leaf)).collect();
    let (lump_of, lumps) =
        surface.parts(|_| true, |from, link| !link.is_ledge() && cube[from] == cube[link.to]);
    let fine = System::of(surface);
    let coarse = fine.lumped(surface, &lump_of, &lumps).solve(surface, vec![0.0; lumps.len()]);
    let mut fill: Vec<f64> = lump_of.iter().map(|&lump| coarse[lump as usize]).collect();
    for _ in 0..SWEEPS {
        surface.asked.ask();
        let inflow = fine.inflow(&fill);
        fill = (0..surface.len()).map(|i| (fine.sources[i] + inflow[i]) / fine.diagonal[i]).collect();
    }
    fill
}

/// The fill of each node, from a rough one.
pub(crate) fn exact(surface: &Surface, rough: Vec<f64>) -> Vec<f64> {
    System::of(surface).solve(surface, rough)
}

/// What fills each node between those that are `full`, which hold 1, and those that are `empty`.
pub(crate) fn between(surface: &Surface, full: &[bool], empty: &[bool]) -> Vec<f64> {
    System::of(surface).held(full, empty).solve(surface, vec![0.0; surface.len()])
}

/// Most steps of the solver.
const STEPS: usize = 300;
/// It is done when so much of the error is left.
const LEFT: f64 = 1e-3;

/// A flow to another node or lump for a unit of fill.
type Flow = (u32, f32);

/// What flows where.
struct System {
    /// The flows of each.
    flows: Vec<Vec<Flow>>,
    /// What leaves each for a unit of fill: its flows, and what is lost.
    diagonal: Vec<f64>,
    sources: Vec<f64>,
}

impl System {
    fn of(surface: &Surface) -> Self {
        let squared = |way: Vec3| dot(way, way);
        let of_node = |node: usize| {
            surface.asked.ask_at(node);
            let (mut flows, mut source, mut spread) = (Vec::with_capacity(24), 0.0, 0.0);
            for link in surface.links(node) {
                if link.is_ledge() {
                    source -= f64::from(link.rise.signum());
                } else {
                    spread += squared(sub(surface.places[link.to], surface.places[node]));
                    flows.push((link.to as u32, 1.0));
                }
            }
            (flows, source, spread)
        };
        let nodes: Vec<(Vec<Flow>, f64, f64)> =
            (0..surface.len()).into_par_iter().panic_fuse().map(of_node).collect();
        let spread = nodes.iter().map(|n| n.2).sum::<f64>() / 4.0;
        let lost = spread / surface.len().max(1) as f64 / (LOST_MM * LOST_MM);
        let diagonal = nodes.iter().map(|n| n.0.len() as f64 + lost).collect();
        let (flows, sources) = nodes.into_iter().map(|(flows, source, _)| (flows, source)).unzip();
        Self { flows, diagonal, sources }
    }

    /// What is lost in each.
    fn losses(&self) -> impl Iterator<Item = f64> {
        self.flows.iter().zip(&self.diagonal).map(|(f, d)| d - f.iter().map(|f| f64::from(f.1)).sum::<f64>())
    }

    /// The same with the nodes of a lump taken together.
    fn lumped(&self, surface: &Surface, lump_of: &[u32], lumps: &[Vec<usize>]) -> Self {
        let middle = |nodes: &Vec<usize>| {
            let total = nodes.iter().fold([0.0; 3], |sum, &n| add(sum, surface.places[n]));
            scale(total, 1.0 / nodes.len() as f64)
        };
        let middle: Vec<Vec3> = lumps.par_iter().map(middle).collect();
        let losses: Vec<f64> = self.losses().collect();
        let of_lump = |lump: usize| {
            surface.asked.ask_at(lump);
            let mut flows: Vec<Flow> = Vec::with_capacity(16);
            for &node in &lumps[lump] {
                for (to, _) in &self.flows[node] {
                    let other = lump_of[*to as usize];
                    if other as usize == lump {
                        continue;
                    }
                    // So that a steady slope makes the same flow as between the nodes.
                    let way = sub(surface.places[*to as usize], surface.places[node]);
                    let apart = sub(middle[other as usize], middle[lump]);
                    let flow = (dot(way, apart) / dot(apart, apart)).max(0.0) as f32;
                    match flows.iter_mut().find(|f| f.0 == other) {
                        Some(found) => found.1 += flow,
                        None => flows.push((other, flow)),
                    }
                }
            }
            let sum = |of: &[f64]| lumps[lump].iter().map(|&n| of[n]).sum::<f64>();
            let out = flows.iter().map(|f| f64::from(f.1)).sum::<f64>() + sum(&losses);
            (flows, out, sum(&self.sources))
        };
        let lumps: Vec<(Vec<Flow>, f64, f64)> =
            (0..lumps.len()).into_par_iter().panic_fuse().map(of_lump).collect();
        let mut system = Self { flows: Vec::new(), diagonal: Vec::new(), sources: Vec::new() };
        for (flows, out, source) in lumps {
            system.flows.push(flows);
            system.diagonal.push(out);
            system.sources.push(source);
        }
        system
    }

    /// The same with no other source than those that are `full` and hold 1, while those that are
    /// `empty` hold 0.
    fn held(mut self, full: &[bool], empty: &[bool]) -> Self {
        for node in 0..full.len() {
            if full[node] || empty[node] {
                self.flows[node].clear();
                (self.diagonal[node], self.sources[node]) = (1.0, f64::from(u8::from(full[node])));
            } else {
                let fed = self.flows[node].iter().filter(|f| full[f.0 as usize]).map(|f| f64::from(f.1));
                self.sources[node] = fed.sum();
                self.flows[node].retain(|f| !full[f.0 as usize] && !empty[f.0 as usize]);
            }
        }
        self
    }

    /// What flows into each from the others.
    fn inflow(&self, fill: &[f64]) -> Vec<f64> {
        let into = |to: &Vec<Flow>| to.iter().map(|(to, flow)| f64::from(*flow) * fill[*to as usize]).sum();
        self.flows.par_iter().with_min_len(1024).map(into).collect()
    }

    /// Conjugate gradients with the diagonal as preconditioner.
    fn solve(&self, surface: &Surface, start: Vec<f64>) -> Vec<f64> {
        let product = |v: &[f64]| -> Vec<f64> {
            self.inflow(v).iter().enumerate().map(|(i, inflow)| self.diagonal[i] * v[i] - inflow).collect()
        };
        let scalar = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let scaled = |v: &[f64]| -> Vec<f64> { v.iter().zip(&self.diagonal).map(|(v, d)| v / d).collect() };
        let mut fill = start;
        let mut rest: Vec<f64> = product(&fill).iter().zip(&self.sources).map(|(p, s)| s - p).collect();
        let mut direction = scaled(&rest);
        let mut size = scalar(&rest, &direction);
        let enough = scalar(&self.sources, &scaled(&self.sources)) * LEFT * LEFT;
        for _ in 0..STEPS {
            surface.asked.ask();
            if size <= enough {
                break;
            }
            let along = product(&direction);
            let step = size / scalar(&direction, &along);
            for (i, v) in fill.iter_mut().enumerate() {
                *v += step * direction[i];
                rest[i] -= step * along[i];
            }
            let near = scaled(&rest);
            let next = scalar(&rest, &near);
            for (d, n) in direction.iter_mut().zip(&near) {
                *d = n + next / size * *d;
            }
            size = next;
        }
        fill
    }
}
