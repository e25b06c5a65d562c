//! The couch and what else has the same cross-section in every slice: boards, holders, rails.

use rayon::prelude::*;

use crate::observer::stop::Asked;
use crate::pipeline::precise::grid::reach::within;
use crate::pipeline::precise::labels::label::{BALL_MM, Label};
use crate::pipeline::precise::scan::survey::Survey;

/// A column along the table counts as filled if this share of it is.
const SHARE: f64 = 0.97;
/// A filled outline counts as couch if what stands next to its border is, on average along the
/// table, empty to this share. (A head that the scan cuts above and below is filled too, but it
/// slopes on from there.)
const FREE_BORDER: f64 = 0.5;
/// Shorter scans than this show too little of the table to tell, mm.
const LEAST_LENGTH_MM: f64 = 60.0;

/// What has the same cross-section along the whole scan.
#[derive(Debug, PartialEq)]
pub(crate) struct Outline {
    /// Its cells.
    pub(crate) cells: Vec<usize>,
    /// Whether its cross-section is too thin for the ball that finds the patient's body.
    pub(crate) thin: bool,
}

/// Marks as [`Label::Other`] the tissue that runs along the whole scan parallel to the table.
pub(crate) fn mark(asked: Asked<'_>, survey: &Survey, labels: &mut [Label]) -> Vec<Outline> {
    let cells = &survey.cells;
    let [nx, ny, nz] = cells.shape;
    let layer = nx * ny;
    let (mut seen, mut full) = (vec![0u32; layer], vec![0u32; layer]);
    let each = seen.par_chunks_mut(nx).zip(full.par_chunks_mut(nx)).enumerate().panic_fuse();
    each.for_each(|(y, (seen, full))| {
        asked.ask();
        for row in (0..nz).map(|z| z * layer + y * nx) {
            for (x, (seen, full)) in seen.iter_mut().zip(&mut *full).enumerate() {
                let is_seen = survey.seen[row + x];
                *seen += u32::from(is_seen);
                *full += u32::from(is_seen && labels[row + x] != Label::Air);
            }
        }
    });
    let long = |i: usize| f64::from(seen[i]) * cells.edge >= LEAST_LENGTH_MM;
    let share = |i: usize| f64::from(full[i]) / f64::from(seen[i].max(1));
    let filled: Vec<bool> = (0..layer).map(|i| long(i) && share(i) >= SHARE).collect();
    let emptiness = |i: usize| if long(i) { 1.0 - share(i) } else { 1.0 };
    let at_border = within(asked, [nx, ny, 1], cells.squared(BALL_MM), |i| !filled[i]);
    let mut marked = Vec::new();
    for outline in outlines(nx, ny, &filled) {
        asked.ask();
        let (mut border, mut free) = (0usize, 0f64);
        for &i in &outline {
            let (x, y) = (i % nx, i / nx);
            for (dx, dy) in [(-1isize, 0isize), (1, 0), (0, -1), (0, 1)] {
                let step = |n: isize| {
                    let (x, y) = (x.checked_add_signed(dx * n)?, y.checked_add_signed(dy * n)?);
                    (x < nx && y < ny).then_some(y * nx + x)
                };
                if step(1).is_some_and(|j| filled[j]) {
                    continue;
                }
                border += 1;
                free += (1..=3).map(|n| step(n).map_or(1.0, emptiness)).fold(0.0, f64::max);
            }
        }
        if free < FREE_BORDER * border as f64 {
            continue;
        }
        let thin = outline.iter().all(|&i| at_border[i]);
        let columns = outline.into_iter().flat_map(|i| (0..nz).map(move |z| z * layer + i));
        let found: Vec<usize> = columns.filter(|&i| labels[i] == Label::Patient).collect();
        for &i in &found {
            labels[i] = Label::Other;
        }
        marked.push(Outline { cells: found, thin });
    }
    marked
}

/// The connected outlines of a plane mask, each as a list of offsets.
fn outlines(nx: usize, ny: usize, mask: &[bool]) -> Vec<Vec<usize>> {
    let mut done = vec![false; mask.len()];
    let mut found = Vec::new();
    for first in 0..mask.len() {
        if !mask[first] || done[first] {
            continue;
        }
        done[first] = true;
        let mut outline = vec![first];
        let mut next = 0;
        while next < outline.len() {
            let (x, y) = (outline[next] % nx, outline[next] / nx);
            next += 1;
            let neighbours = [
                (x > 0).then(|| y * nx + x - 1),
                (x + 1 < nx).then(|| y * nx + x + 1),
                (y > 0).then(|| (y - 1) * nx + x),
                (y + 1 < ny).then(|| (y + 1) * nx + x),
            ];
            for j in neighbours.into_iter().flatten() {
                if mask[j] && !done[j] {
                    done[j] = true;
                    outline.push(j);
                }
            }
        }
        found.push(outline);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::precise::grid::cells::Cells;

    #[test]
    fn a_plate_is_a_thin_outline_and_a_block_is_none() {
        let cells = Cells { origin: [0.0; 3], edge: 1.0, shape: [60, 40, 80] };
        let n = cells.len();
        let (below, aside) = (vec![false; n], vec![false; n]);
        let survey = Survey { cells, hu: vec![0; n], seen: vec![true; n], below, aside };
        let plate = |[x, y, _]: [usize; 3]| (5..55).contains(&x) && (30..34).contains(&y);
        let block = |[x, y, _]: [usize; 3]| (10..30).contains(&x) && (3..23).contains(&y);
        let solid = |at| plate(at) || block(at);
        let kind = |i| if solid(cells.cell(i).0) { Label::Patient } else { Label::Air };
        let mut labels: Vec<Label> = (0..n).map(kind).collect();
        let found = mark(Asked::default(), &survey, &mut labels);
        assert_eq!(found.len(), 2);
        for outline in found {
            let is_plate = plate(cells.cell(outline.cells[0]).0);
            assert_eq!(outline.thin, is_plate);
            assert_eq!(outline.cells.len(), if is_plate { 50 * 4 } else { 20 * 20 } * 80);
            assert!(outline.cells.iter().all(|&i| plate(cells.cell(i).0) == is_plate));
        }
        assert!(labels.iter().all(|k| *k != Label::Patient), "both are marked as no patient's");
    }
}
