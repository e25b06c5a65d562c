//! Sheets over the skin: masks, cloth, straps that stand off it.
//!
//! A ray that goes in through a sheet leaves it after a few mm, crosses a gap and meets the patient
//! behind. So it does at an ear or a nostril; but those are small, and a sheet reaches further than
//! any of them. Where a sheet lies on the skin no gap shows: there its outer face goes on smoothly
//! from where the sheet stands off, while the skin begins behind a step. Such stretches are given to
//! the sheet, since nobody can tell where the skin is below them.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use rayon::prelude::*;

use super::large::are_large;
use crate::geometry::{Vec3, add, dot, normalised, scale};
use crate::pipeline::precise::grid::cells::Cells;
use crate::pipeline::precise::grid::index::Cell;
use crate::pipeline::precise::grid::reach::within;
use crate::pipeline::precise::labels::label::Label;
use crate::pipeline::precise::scan::levels::Levels;
use crate::pipeline::precise::scan::sampler::Sampler;

/// No sheet is thicker, mm.
const THICKEST_MM: f64 = 4.5;
/// The gap below a sheet is no wider, mm.
const WIDEST_GAP_MM: f64 = 10.0;
/// Step of the ray, mm.
const STEP_MM: f64 = 0.4;
/// A sheet's outer face goes on at most so far over the skin, mm.
const CONTACT_MM: f64 = 40.0;
/// On the way from the skin there is a step if its turns cost more than this, mm of way: else the skin simply
/// goes on to the sheet, as it does beside a cord.
/// Measured by `tests/interop/heads.sh … cord cannula`: at 8 and 15 mm coverage differs by no more than 0.004.
const STEP_COST: f64 = 15.0;
/// A turn between two cells of less is none, rad.
const LEAST_TURN: f64 = 0.15;
/// What a radian of turn costs on the way along a surface, in mm of way.
const TURN_COST: f64 = 60.0;
/// Normals are taken from the tissue within so many cells.
const NORMAL_REACH: isize = 3;

/// Marks as [`Label::Attached`] the cells of every sheet; `open` tells the air outside.
pub(crate) fn peel(
    sampler: &Sampler,
    levels: &Levels,
    cells: &Cells,
    labels: &mut [Label],
    open: impl Fn(usize) -> bool + Sync,
) {
    let mut border = border(sampler, cells, labels);
    border.retain(|&i| cells.around(i).any(|(j, _)| open(j)));
    let layers: Vec<(usize, Layer)> = border
        .par_iter()
        .enumerate()
        .panic_fuse()
        .filter_map(|(n, &i)| {
            sampler.ask_at(n);
            let normal = normal(cells, labels, i)?;
            layer(sampler, levels, cells.centre(cells.cell(i)), normal).map(|l| (i, l))
        })
        .collect();
    let large = are_large(sampler.asked(), cells, &layers.iter().map(|l| l.0).collect::<Vec<_>>(), |_| true);
    let foreign: Vec<(usize, Layer)> =
        layers.into_iter().zip(large).filter(|(_, large)| *large).map(|(layer, _)| layer).collect();
    if foreign.is_empty() {
        return;
    }
    let mut sheet: Vec<usize> = Vec::new();
    for (n, (_, layer)) in foreign.iter().enumerate() {
        sampler.ask_at(n);
        let mut depth = -cells.edge;
        while depth <= layer.to + 0.25 * cells.edge {
            let p = add(layer.start, scale(layer.normal, -depth));
            if let Some(cell) = cells.at(p) {
                let offset = cells.offset(cell);
                if labels[offset] == Label::Patient {
                    sheet.push(offset);
                }
            }
            depth += 0.5 * cells.edge;
        }
    }
    sheet.sort_unstable();
    sheet.dedup();
    let outer: Vec<(usize, Vec3)> = foreign.iter().map(|(i, l)| (*i, l.normal)).collect();
    for &i in &sheet {
        labels[i] = Label::Attached;
    }
    let skin: Vec<usize> = foreign
        .iter()
        .filter(|(_, l)| l.behind - l.to > cells.edge)
        .filter_map(|(_, l)| cells.at(add(l.start, scale(l.normal, -l.behind - 0.3 * cells.edge))))
        .map(|cell| cells.offset(cell))
        .collect();
    let faces = Faces { border: &border, outer: &outer, skin: &skin };
    let contact = contact(sampler, cells, labels, &faces);
    for i in contact {
        labels[i] = Label::Attached;
    }
}

/// A thin layer that a ray met, with a gap and more tissue behind it.
#[derive(Debug, Clone, Copy)]
struct Layer {
    /// Where the ray began, LPS mm.
    start: Vec3,
    /// Outward unit normal.
    normal: Vec3,
    /// Where the layer ends, mm in from the start.
    to: f64,
    /// Where the patient begins behind the gap, mm in from the start.
    behind: f64,
}

/// Goes inward from a border cell.
fn layer(sampler: &Sampler, levels: &Levels, start: Vec3, normal: Vec3) -> Option<Layer> {
    let upper = levels.upper();
    let inward = sampler.line(start, scale(normal, -1.0));
    let at = |depth: f64| inward.sample(depth);
    let (mut entry, mut exit) = (None, None);
    let mut depth = -1.5;
    loop {
        let inside = at(depth)? >= upper;
        match (entry, exit) {
            (None, _) if inside => entry = Some(depth),
            (None, _) if depth > 1.5 => return None,
            (Some(from), None) if !inside => exit = Some((from, depth)),
            (Some(from), None) if depth - from > THICKEST_MM => return None,
            (_, Some((_, to))) if inside => return Some(Layer { start, normal, to, behind: depth }),
            (_, Some((_, to))) if depth - to > WIDEST_GAP_MM => return None,
            _ => {}
        }
        depth += STEP_MM;
    }
}

/// Where the search along the surface goes, and where it begins.
struct Faces<'a> {
    /// The cells of the border.
    border: &'a [usize],
    /// The outer faces of the sheets, with their normals.
    outer: &'a [(usize, Vec3)],
    /// Cells that are skin for sure.
    skin: &'a [usize],
}

/// The stretches of the patient's border that are reached along the surface from the outer faces of the
/// sheets at less cost than from the skin, and from the skin over a step alone: where the sheet lies on it.
fn contact(sampler: &Sampler, cells: &Cells, labels: &[Label], faces: &Faces<'_>) -> Vec<usize> {
    let Faces { border, outer, skin } = *faces;
    let near =
        within(sampler.asked(), cells.shape, cells.squared(CONTACT_MM), |i| labels[i] == Label::Attached);
    // A turn is told from normals at the same scale on both.
    let thing = |k: Label| matches!(k, Label::Patient | Label::Attached);
    let mut normals: HashMap<usize, Vec3> = HashMap::new();
    for (i, n) in outer {
        normals.insert(*i, *n);
    }
    for (n, &i) in border.iter().enumerate().filter(|(_, i)| labels[**i] == Label::Patient) {
        let beside = || cells.around(i).any(|(j, _)| near[j]);
        sampler.ask_at(n);
        if (near[i] || beside())
            && let Some(n) = normal_of(cells, labels, i, thing)
        {
            normals.insert(i, n);
        }
    }
    let is_skin = |i: &usize| labels[*i] == Label::Patient && normals.contains_key(i);
    let beyond = border.iter().copied().filter(|&i| !near[i]);
    let skin: Vec<usize> = beyond.chain(skin.iter().copied()).filter(is_skin).collect();
    let outer: Vec<usize> = outer.iter().map(|(i, _)| *i).collect();
    let [from_skin, from_sheet] = [&skin, &outer].map(|from| ways(sampler, cells, &normals, from));
    let is_contact = |&(i, from_sheet): &(&usize, &Way)| {
        let beyond_step =
            |from_skin: &Way| from_skin.turned > STEP_COST && from_sheet.cost() < from_skin.cost();
        labels[*i] == Label::Patient && from_skin.get(i).is_none_or(beyond_step)
    };
    let mut contact: Vec<usize> = from_sheet.iter().filter(is_contact).map(|(i, _)| *i).collect();
    contact.sort_unstable();
    contact
}

/// A way along the surface, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Way {
    long: f64,
    /// What its turns cost.
    turned: f64,
}

impl Way {
    fn cost(self) -> f64 {
        self.long + self.turned
    }
}

/// The cheapest way to each cell of the border from any of some.
fn ways(
    sampler: &Sampler,
    cells: &Cells,
    normals: &HashMap<usize, Vec3>,
    from: &[usize],
) -> HashMap<usize, Way> {
    let start = Way { long: 0.0, turned: 0.0 };
    let mut best: HashMap<usize, Way> = from.iter().map(|&i| (i, start)).collect();
    let mut queue: BinaryHeap<(Reverse<Cost>, usize)> =
        from.iter().map(|&i| (Reverse(Cost(0.0)), i)).collect();
    let mut step = 0;
    while let Some((Reverse(Cost(cost)), i)) = queue.pop() {
        step += 1;
        sampler.ask_at(step);
        let way = best[&i];
        if way.cost() < cost {
            continue;
        }
        let n = normals[&i];
        for (j, axes) in cells.around(i) {
            let Some(m) = normals.get(&j) else { continue };
            let turn = dot(n, *m).clamp(-1.0, 1.0).acos();
            let to = Way {
                long: way.long + (axes as f64).sqrt() * cells.edge,
                turned: way.turned + TURN_COST * (turn - LEAST_TURN).max(0.0),
            };
            if best.get(&j).is_none_or(|best| to.cost() < best.cost()) {
                best.insert(j, to);
                queue.push((Reverse(Cost(to.cost())), j));
            }
        }
    }
    best
}

/// A cost that can be ordered.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cost(f64);

impl Eq for Cost {}

impl Ord for Cost {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Cost {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// The patient's cells that share a face with air.
fn border(sampler: &Sampler, cells: &Cells, labels: &[Label]) -> Vec<usize> {
    let [nx, ny, nz] = cells.shape;
    let (row, layer) = (nx, nx * ny);
    (1..nz - 1)
        .into_par_iter()
        .panic_fuse()
        .flat_map_iter(|z| {
            sampler.ask();
            let mut found = Vec::new();
            for y in 1..ny - 1 {
                for x in 1..nx - 1 {
                    let i = z * layer + y * row + x;
                    if labels[i] == Label::Patient
                        && [i - 1, i + 1, i - row, i + row, i - layer, i + layer]
                            .into_iter()
                            .any(|j| labels[j] == Label::Air)
                    {
                        found.push(i);
                    }
                }
            }
            found
        })
        .collect()
}

/// Outward unit normal of a border cell of the patient.
fn normal(cells: &Cells, labels: &[Label], i: usize) -> Option<Vec3> {
    normal_of(cells, labels, i, |k| k != Label::Air)
}

/// Outward unit normal from the mean place of the solid cells around.
fn normal_of(cells: &Cells, labels: &[Label], i: usize, solid: impl Fn(Label) -> bool) -> Option<Vec3> {
    let Cell([x, y, z]) = cells.cell(i);
    let r = NORMAL_REACH;
    let mut sum = [0.0; 3];
    for dz in -r..=r {
        for dy in -r..=r {
            for dx in -r..=r {
                let step = [dx, dy, dz];
                let (Some(x), Some(y), Some(z)) =
                    (x.checked_add_signed(dx), y.checked_add_signed(dy), z.checked_add_signed(dz))
                else {
                    continue;
                };
                if x < cells.shape[0]
                    && y < cells.shape[1]
                    && z < cells.shape[2]
                    && solid(labels[cells.offset(Cell([x, y, z]))])
                {
                    for a in 0..3 {
                        sum[a] -= step[a] as f64;
                    }
                }
            }
        }
    }
    normalised(sum)
}
