//! What hangs on the body: thin pieces, of which ears, nose and jaw are the patient's and holders,
//! straps, tubes and rods are not.
//!
//! The patient's own are small; what is longer of them, as a nose with the wall of a frontal sinus, has a
//! cavity behind it, while a foreign one stands free in the open air.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::large::{Bounds, LARGEST_PART_MM, are_large};
use crate::observer::stop::Asked;
use crate::pipeline::precise::grid::cells::Cells;
use crate::pipeline::precise::grid::index::Cell;
use crate::pipeline::precise::grid::pieces::Pieces;
use crate::pipeline::precise::grid::rays::{directions, enclosure, ray};
use crate::pipeline::precise::labels::label::Label;

/// Ears and noses reach no further from the body, mm.
const FURTHEST_MM: f64 = 45.0;
/// What reaches further from no larger foot is a rod or a tube, mm². Of something wider the root would stay;
/// it is left to the search for ledges.
const LARGEST_FOOT_MM2: f64 = 120.0;
/// What stands free is no thicker, mm.
const THICK_MM: f64 = 12.0;
/// So many cells tell how far something reaches.
const ENOUGH: usize = 2000;
/// Where so much of the view from a part is the patient, it is the patient's all the same: the walls of
/// the sinuses and of the mastoid's cells.
const ENCLOSED: f64 = 0.65;

/// Marks as [`Label::Other`] what hangs on nothing, and as [`Label::Attached`] what hangs on the body (the
/// patient's cells that are `near` the core) and is foreign; `is_open` tells the air outside.
pub(crate) fn judge(
    asked: Asked<'_>,
    cells: &Cells,
    labels: &mut [Label],
    near: &[bool],
    is_open: impl Fn(usize) -> bool + Sync,
) {
    let (apart, attached) = foreign(asked, cells, labels, near, is_open);
    for i in apart {
        labels[i] = Label::Other;
    }
    for i in attached {
        labels[i] = Label::Attached;
    }
}

fn foreign(
    asked: Asked<'_>,
    cells: &Cells,
    labels: &[Label],
    near: &[bool],
    is_open: impl Fn(usize) -> bool + Sync,
) -> (Vec<usize>, Vec<usize>) {
    let is_body = |i: usize| labels[i] == Label::Patient && near[i];
    let parts = Parts::of(asked, cells, |i| labels[i] == Label::Patient && !near[i], is_body);
    let in_view = |i: &usize| {
        asked.ask();
        enclosure(cells, *i, is_body) < ENCLOSED
    };
    let stands_free = |i: usize| stands_free(cells, i, |j| labels[j] != Label::Air, &is_open);
    let long: Vec<usize> = parts.long.into_par_iter().panic_fuse().filter(in_view).collect();
    let is_large = are_large(asked, cells, &long, stands_free);
    let mut attached: Vec<usize> =
        long.into_iter().zip(is_large).filter(|(_, large)| *large).map(|(i, _)| i).collect();
    for (part, roots) in parts.short {
        asked.ask();
        let foot_mm2 = roots.len() as f64 * cells.edge * cells.edge;
        if foot_mm2 <= LARGEST_FOOT_MM2 && reach(cells, &part, &roots) > FURTHEST_MM {
            let part: Vec<usize> = part.into_par_iter().panic_fuse().filter(in_view).collect();
            let free = part.par_iter().filter(|i| stands_free(**i)).count();
            if 2 * free >= part.len() {
                attached.extend(part);
            }
        }
    }
    (parts.apart, attached)
}

/// The thin pieces, as offsets of their cells.
struct Parts {
    /// What hangs on nothing.
    apart: Vec<usize>,
    /// All that are longer than any thin part of a head.
    long: Vec<usize>,
    /// Each of the others that can reach far, with those of its cells that touch the body.
    short: Vec<(Vec<usize>, Vec<usize>)>,
}

impl Parts {
    fn of(
        asked: Asked<'_>,
        cells: &Cells,
        is_thin: impl Fn(usize) -> bool + Sync,
        is_body: impl Fn(usize) -> bool + Sync,
    ) -> Self {
        let pieces = Pieces::of(asked, cells.shape, is_thin);
        let mut found: Vec<(Bounds, Vec<usize>)> = vec![Default::default(); pieces.sizes().len()];
        pieces.each_row(|[y, z], run| {
            asked.ask_at(y);
            let (bounds, roots) = &mut found[run.piece as usize];
            for x in run.start as usize..run.end as usize {
                bounds.add(Cell([x, y, z]));
                let offset = cells.offset(Cell([x, y, z]));
                if cells.around(offset).any(|(i, axes)| axes == 1 && is_body(i)) {
                    roots.push(offset);
                }
            }
        });
        let mut parts = Self { apart: Vec::new(), long: Vec::new(), short: Vec::new() };
        let mut short: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        pieces.each_row(|[y, z], run| {
            asked.ask_at(y);
            let start = cells.offset(Cell([run.start as usize, y, z]));
            let run_of = start..start + (run.end - run.start) as usize;
            let (bounds, roots) = &found[run.piece as usize];
            let diagonal = bounds.diagonal() * cells.edge;
            if roots.is_empty() {
                parts.apart.extend(run_of);
            } else if diagonal > LARGEST_PART_MM {
                parts.long.extend(run_of);
            } else if diagonal > FURTHEST_MM {
                short.entry(run.piece).or_default().extend(run_of);
            }
        });
        let with_roots = |(piece, part): (u32, _)| (part, std::mem::take(&mut found[piece as usize].1));
        parts.short = short.into_iter().map(with_roots).collect();
        parts
    }
}

/// How far a part reaches from the nearest of its `roots`, mm, to about a cell's edge.
fn reach(cells: &Cells, part: &[usize], roots: &[usize]) -> f64 {
    let some = |of: &[usize]| -> Vec<Cell> {
        of.iter().step_by(of.len() / ENOUGH + 1).map(|&i| cells.cell(i)).collect()
    };
    let roots = some(roots);
    let to_root = |cell: Cell| {
        let squared = |root: &Cell| (0..3).map(|a| cell[a].abs_diff(root[a]).pow(2)).sum::<usize>();
        roots.iter().map(squared).min().unwrap_or(0)
    };
    let furthest = some(part).into_par_iter().map(to_root).max().unwrap_or(0);
    (furthest as f64).sqrt() * cells.edge
}

/// Whether something thin stands free at a cell, as a plate, a tube, an ear: along some direction the first
/// that is not `solid` on both sides is open.
fn stands_free(
    cells: &Cells,
    cell: usize,
    solid: impl Fn(usize) -> bool,
    is_open: impl Fn(usize) -> bool,
) -> bool {
    let solid_cells = |way: [isize; 3]| {
        let (ray, _) = ray(cells, cell, way, THICK_MM);
        let (before, end) = ray.enumerate().find(|(_, i)| !solid(*i))?;
        is_open(end).then_some(before)
    };
    // Half of the directions: the others are their opposites.
    directions().take(13).any(|way| {
        let step = way.iter().map(|v| (v * v) as f64).sum::<f64>().sqrt() * cells.edge;
        let both = solid_cells(way).zip(solid_cells(way.map(|v| -v)));
        both.is_some_and(|(there, back)| (there + 1 + back) as f64 * step < THICK_MM)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::precise::grid::cells::each_cell;

    /// A block whose face is at z = 60, with things on it.
    #[test]
    fn ears_and_noses_stay_and_plates_and_rods_go() {
        let cells = Cells { origin: [0.0; 3], edge: 1.0, shape: [180, 180, 130] };
        let is_in = |v: usize, from: usize, size: usize| (from..from + size).contains(&v);
        let plate = |[x, y, z]: [usize; 3]| is_in(x, 20, 120) && is_in(y, 20, 4) && is_in(z, 60, 30);
        let rod = |[x, y, z]: [usize; 3]| is_in(x, 30, 8) && is_in(y, 50, 8) && is_in(z, 60, 60);
        let ear = |[x, y, z]: [usize; 3]| is_in(x, 60, 60) && is_in(y, 60, 4) && is_in(z, 60, 30);
        let cavity = |[x, y, z]: [usize; 3]| is_in(x, 34, 102) && is_in(y, 104, 22) && is_in(z, 50, 26);
        let nose = |at @ [x, y, z]: [usize; 3]| {
            is_in(x, 30, 110) && is_in(y, 100, 30) && is_in(z, 60, 20) && !cavity(at)
        };
        let crumb = |[x, y, z]: [usize; 3]| is_in(x, 150, 3) && is_in(y, 150, 3) && is_in(z, 80, 3);
        let body = |at: [usize; 3]| is_in(at[2], 10, 50) && !cavity(at);
        let kind = |at| match body(at) || plate(at) || rod(at) || ear(at) || nose(at) || crumb(at) {
            true => Label::Patient,
            false => Label::Air,
        };
        let mut labels: Vec<Label> = (0..cells.len()).map(|i| kind(cells.cell(i).0)).collect();
        let before = labels.clone();
        let near: Vec<bool> = (0..cells.len()).map(|i| body(cells.cell(i).0)).collect();
        judge(Asked::default(), &cells, &mut labels, &near, |i| {
            before[i] == Label::Air && !cavity(cells.cell(i).0)
        });
        let expected = |at| match at {
            at if body(at) || ear(at) || nose(at) => Label::Patient,
            at if plate(at) || rod(at) => Label::Attached,
            at if crumb(at) => Label::Other,
            _ => Label::Air,
        };
        let mut wrong = 0;
        each_cell(&cells, |i, at| wrong += usize::from(labels[i] != expected(at.0)));
        assert_eq!(wrong, 0);
    }
}
