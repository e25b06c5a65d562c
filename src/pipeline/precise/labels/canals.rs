//! Nostrils, ear canals and other narrow ways into the head: closed at their rim.
//!
//! Narrow air, that the ball of [`super::outside`] does not reach, is a fold of the skin where it
//! ends soon and a canal where it goes deep. A canal's rim is where the head closes in on all
//! sides: from within no straight line leads out to both sides, however it is turned, while in a
//! fold (behind an ear, between nose and lip) one along the fold does.

use std::collections::HashMap;
use std::f64::consts::PI;

use rayon::prelude::*;

use super::air::Air;
use crate::geometry::{Vec3, add, scale};
use crate::observer::stop::Asked;
use crate::pipeline::precise::grid::cells::Cells;

/// How far beyond the ball's reach a fold is still skin, mm.
const FOLD_MM: f64 = 6.0;
/// Narrow air deeper than this is no fold but a canal, mm.
const CANAL_MM: f64 = 12.0;
/// A canal's rim is looked for no further out than this before the narrow air, mm: as far, the ball of
/// [`super::outside`] reaches into a wide nostril.
const RIM_MM: f64 = 8.0;
/// Further out than this all the lines must be shut: a bowl around it (a concha) is skin, mm.
const NEAR_RIM_MM: f64 = 6.0;
/// Straight lines through a place, half a turn of them.
const LINES: u32 = 256;
/// A line is free if it meets nothing so far to both sides, mm.
const FREE_MM: f64 = 7.0;
/// A place is within a canal if less than the first share of the lines is free, and at its rim if less than
/// the second is and it lies next to places within it.
const FREE: (f64, f64) = (0.03, 0.1);
/// The same further out than [`NEAR_RIM_MM`].
const FREE_FAR: (f64, f64) = (1.0 / LINES as f64, 0.03);
/// Next to it are so many of the 26 around, at least.
const RIM_NEIGHBOURS: usize = 6;
/// Chamfer steps of the walk through narrow air, in thirds of a cell, by how many axes they go along.
const STEPS: [u32; 4] = [0, 3, 4, 5];

/// How closed in a cell before a canal is.
struct Judged {
    cell: usize,
    within: bool,
    at_rim: bool,
}

/// Marks the narrow air that is fold (open) and the one that is canal: what lies deeper than a
/// fold, and on the way from the open air to what is deeper than any fold what is closed in.
pub(crate) fn close_canals(asked: Asked<'_>, cells: &Cells, air: &mut [Air]) {
    let thirds = |mm: f64| (mm / cells.edge * 3.0).round() as u32;
    let (fold, canal) = (thirds(FOLD_MM), thirds(CANAL_MM));
    let from = next_to_narrow(asked, cells, air);
    let narrow = walk(asked, cells, &from, canal + 5, |i| air[i] == Air::Enclosed);
    let deep: Vec<usize> = narrow.iter().filter(|&&(_, d)| d > canal).map(|&(i, _)| i).collect();
    let asking = narrow.into_iter().enumerate().inspect(|(number, _)| asked.ask_at(*number));
    let depth: HashMap<usize, u32> = asking.map(|(_, one)| one).collect();
    let back =
        walk(asked, cells, &deep, canal + thirds(RIM_MM), |i| air[i] == Air::Open || depth.contains_key(&i));
    let lines = directions();
    let near = canal + thirds(NEAR_RIM_MM);
    let judged: Vec<Judged> = back
        .into_par_iter()
        .filter(|(i, _)| depth.get(i).is_none_or(|&d| d <= fold))
        .panic_fuse()
        .map(|(cell, d)| {
            asked.ask();
            let free = free_share(cells, air, &lines, cell);
            let (within, at_rim) = if d > near { FREE_FAR } else { FREE };
            Judged { cell, within: free < within, at_rim: free < at_rim }
        })
        .collect();
    for (number, (i, d)) in depth.into_iter().enumerate() {
        asked.ask_at(number);
        air[i] = if d > fold { Air::Canal } else { Air::Open };
    }
    for canal in judged.iter().filter(|j| j.within) {
        air[canal.cell] = Air::Canal;
    }
    let next_to_canal = |i: usize| {
        asked.ask();
        let closed = cells.around(i).filter(|&(j, _)| air[j] == Air::Canal);
        closed.count() >= RIM_NEIGHBOURS
    };
    let rim: Vec<usize> =
        judged.iter().filter(|j| j.at_rim && next_to_canal(j.cell)).map(|j| j.cell).collect();
    for i in rim {
        air[i] = Air::Canal;
    }
}

/// Unit vectors spread evenly over half a sphere (a spiral in steps of the golden angle).
fn directions() -> Vec<Vec3> {
    let golden = PI * (3.0 - 5f64.sqrt());
    (0..LINES)
        .map(|k| {
            let z = 1.0 - (f64::from(k) + 0.5) / f64::from(LINES);
            let (r, turn) = ((1.0 - z * z).sqrt(), golden * f64::from(k));
            [r * turn.cos(), r * turn.sin(), z]
        })
        .collect()
}

/// The share of the straight lines through a cell that are free to both sides, 0 to 1.
fn free_share(cells: &Cells, air: &[Air], lines: &[Vec3], cell: usize) -> f64 {
    let from = cells.centre(cells.cell(cell));
    let steps = (FREE_MM / cells.edge).round() as u32;
    let is_free = |way: Vec3| {
        let mut last = Air::Open;
        for step in 1..=steps {
            let at = add(from, scale(way, f64::from(step) * cells.edge));
            match cells.at(at).map(|c| air[cells.offset(c)]) {
                Some(Air::Solid) => return false,
                Some(state) => last = state,
                None => break,
            }
        }
        last == Air::Open
    };
    let free = lines.iter().filter(|&&way| is_free(way) && is_free(scale(way, -1.0))).count();
    free as f64 / lines.len() as f64
}

/// The open cells that share a face with narrow ones: past an edge or a corner a thin wall would let
/// through.
fn next_to_narrow(asked: Asked<'_>, cells: &Cells, air: &[Air]) -> Vec<usize> {
    let narrow = (0..cells.len()).into_par_iter().panic_fuse().filter(|&i| {
        asked.ask_at(i);
        air[i] == Air::Enclosed
    });
    let beside = |i| cells.around(i).filter(|&(j, steps)| steps == 1 && air[j] == Air::Open).map(|(j, _)| j);
    let mut next: Vec<usize> = narrow.flat_map_iter(beside).collect();
    next.par_sort_unstable_by(|a, b| {
        asked.ask_at(*a);
        a.cmp(b)
    });
    next.dedup();
    next
}

/// Cells for which `pass` holds, reached from `from` within `most` chamfer thirds, with their
/// distance; in the order in which they were reached.
fn walk(
    asked: Asked<'_>,
    cells: &Cells,
    from: &[usize],
    most: u32,
    pass: impl Fn(usize) -> bool,
) -> Vec<(usize, u32)> {
    let mut best: HashMap<usize, u32> = HashMap::new();
    let mut buckets: Vec<Vec<usize>> = vec![Vec::new(); most as usize + 6];
    buckets[0] = from.to_vec();
    let mut reached = Vec::new();
    for d in 0..=most {
        let mut i = 0;
        while i < buckets[d as usize].len() {
            let offset = buckets[d as usize][i];
            i += 1;
            asked.ask_at(i);
            if d > 0 {
                if best.get(&offset) != Some(&d) {
                    continue;
                }
                reached.push((offset, d));
                best.insert(offset, 0);
            }
            for (next, steps) in cells.around(offset).filter(|&(next, _)| pass(next)) {
                let total = d + STEPS[steps];
                if total <= most && best.get(&next).is_none_or(|&b| b > total) {
                    best.insert(next, total);
                    buckets[total as usize].push(next);
                }
            }
        }
    }
    reached
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::precise::grid::cells::each_cell;
    use crate::pipeline::precise::grid::index::Cell;

    /// A block of skin that ends at z = 30, with a tube of 5 mm that goes 22 mm in at (20, 20) and a
    /// groove of 4 mm along x, 9 mm deep, at y = 45.
    #[test]
    fn a_tube_is_closed_at_its_rim_and_a_groove_stays_open() {
        let cells = Cells { origin: [0.0; 3], edge: 1.0, shape: [60, 60, 60] };
        let in_tube = |[x, y, z]: [usize; 3]| {
            (8..=30).contains(&z) && x.abs_diff(20).pow(2) + y.abs_diff(20).pow(2) <= 6
        };
        let in_groove = |[_, y, z]: [usize; 3]| (22..=30).contains(&z) && (44..48).contains(&y);
        let mut air: Vec<Air> = (0..cells.len())
            .map(|i| match cells.cell(i).0 {
                [_, _, z] if z > 30 => Air::Open,
                cell if in_tube(cell) || in_groove(cell) => Air::Enclosed,
                _ => Air::Solid,
            })
            .collect();
        close_canals(Asked::default(), &cells, &mut air);
        each_cell(&cells, |i, Cell(cell)| match cell {
            [_, _, z] if z > 31 => assert_eq!(air[i], Air::Open, "open air at {cell:?}"),
            [_, _, z] if in_tube(cell) && z < 29 => assert_ne!(air[i], Air::Open, "tube at {cell:?}"),
            // Where the block ends so does the groove.
            [x, _, z] if in_groove(cell) && (12..48).contains(&x) => {
                let expected = if z > 24 { Air::Open } else { Air::Canal };
                assert_eq!(air[i], expected, "groove at {cell:?}");
            }
            _ => {}
        });
    }
}
