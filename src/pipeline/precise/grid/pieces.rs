//! What hangs together: connected pieces of a 3D mask, held as runs along x.

use rayon::prelude::*;

use super::bit_rows::{BitRows, next};
use crate::observer::stop::Asked;

/// A stretch of marked cells on one row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Run {
    /// First x.
    pub(crate) start: u32,
    /// One past the last x.
    pub(crate) end: u32,
    /// The piece it belongs to, from 0.
    pub(crate) piece: u32,
}

/// The connected pieces of a mask (cells sharing a face hang together).
#[derive(Debug)]
pub(crate) struct Pieces {
    rows: usize,
    runs: Vec<Run>,
    /// Where each row's runs begin in `runs`; one more than there are rows.
    first: Vec<usize>,
    sizes: Vec<u64>,
}

impl Pieces {
    /// Pieces of the mask of `shape = [nx, ny, nz]` whose cell at an offset is marked.
    pub(crate) fn of(asked: Asked<'_>, shape: [usize; 3], marked: impl Fn(usize) -> bool + Sync) -> Self {
        Self::of_rows(asked, shape, &BitRows::by(asked, [shape[0], shape[1] * shape[2]], marked))
    }

    /// Pieces of a mask of `shape = [nx, ny, nz]`.
    pub(crate) fn of_rows(asked: Asked<'_>, [nx, ny, nz]: [usize; 3], mask: &BitRows) -> Self {
        let runs = |row| {
            asked.ask_at(row);
            runs_of(mask.row(row), nx)
        };
        let rows: Vec<Vec<Run>> = (0..ny * nz).into_par_iter().panic_fuse().map(runs).collect();
        let mut first = Vec::with_capacity(rows.len() + 1);
        first.push(0);
        let mut runs = Vec::with_capacity(rows.iter().map(Vec::len).sum());
        for (number, row) in rows.into_iter().enumerate() {
            asked.ask_at(number);
            runs.extend(row);
            first.push(runs.len());
        }
        let mut parents: Vec<u32> = (0..runs.len() as u32).collect();
        asked.ask();
        for row in 0..ny * nz {
            asked.ask_at(row);
            if !row.is_multiple_of(ny) {
                join(&runs, &first, row - 1, row, &mut parents);
            }
            if row >= ny {
                join(&runs, &first, row - ny, row, &mut parents);
            }
        }
        let mut sizes = Vec::new();
        let mut names = vec![u32::MAX; parents.len()];
        asked.ask();
        for (i, run) in runs.iter_mut().enumerate() {
            asked.ask_at(i);
            let root = root(&mut parents, i as u32) as usize;
            if names[root] == u32::MAX {
                names[root] = sizes.len() as u32;
                sizes.push(0);
            }
            run.piece = names[root];
            sizes[run.piece as usize] += u64::from(run.end - run.start);
        }
        Self { rows: ny, runs, first, sizes }
    }

    /// Cells in each piece.
    pub(crate) fn sizes(&self) -> &[u64] {
        &self.sizes
    }

    /// The piece with most cells, if there is any.
    pub(crate) fn largest(&self) -> Option<u32> {
        (0..self.sizes.len()).max_by_key(|&i| self.sizes[i]).map(|i| i as u32)
    }

    /// Calls `f` with `[y, z]` and each run, in order.
    pub(crate) fn each_row(&self, mut f: impl FnMut([usize; 2], Run)) {
        for row in 0..self.first.len() - 1 {
            for run in &self.runs[self.first[row]..self.first[row + 1]] {
                f([row % self.rows, row / self.rows], *run);
            }
        }
    }

    /// The runs of a row.
    pub(crate) fn row(&self, z: usize, y: usize) -> &[Run] {
        let row = z * self.rows + y;
        &self.runs[self.first[row]..self.first[row + 1]]
    }

    /// The piece of a cell, if it is marked.
    #[inline]
    pub(crate) fn at(&self, z: usize, y: usize, x: usize) -> Option<u32> {
        let runs = self.row(z, y);
        let i = runs.partition_point(|r| r.end <= x as u32);
        runs.get(i).filter(|r| r.start <= x as u32).map(|r| r.piece)
    }
}

fn runs_of(row: &[u64], nx: usize) -> Vec<Run> {
    let mut runs = Vec::new();
    let mut start = next(row, 0, nx, true);
    while start < nx {
        let end = next(row, start, nx, false);
        runs.push(Run { start: start as u32, end: end as u32, piece: 0 });
        start = next(row, end, nx, true);
    }
    runs
}

fn join(runs: &[Run], first: &[usize], a: usize, b: usize, parents: &mut [u32]) {
    let (mut i, mut j) = (first[a], first[b]);
    while i < first[a + 1] && j < first[b + 1] {
        let (p, q) = (runs[i], runs[j]);
        if p.start < q.end && q.start < p.end {
            let (p, q) = (root(parents, i as u32), root(parents, j as u32));
            parents[p.max(q) as usize] = p.min(q);
        }
        if p.end <= q.end {
            i += 1;
        } else {
            j += 1;
        }
    }
}

fn root(parents: &mut [u32], mut i: u32) -> u32 {
    while parents[i as usize] != i {
        parents[i as usize] = parents[parents[i as usize] as usize];
        i = parents[i as usize];
    }
    i
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_that_share_a_face_hang_together_and_corners_do_not() {
        // Two layers of 4 × 3: a ring in the first, joined through the second to a far cell.
        let layers = ["##.#", "#..#", "##..", "....", "...#", "...."].concat().into_bytes();
        let pieces = Pieces::of(Asked::default(), [4, 3, 2], |i| layers[i] == b'#');
        assert_eq!(pieces.at(0, 0, 0), pieces.at(0, 2, 1), "round the corner");
        assert_eq!(pieces.at(0, 0, 3), pieces.at(1, 1, 3), "through the layers");
        assert_ne!(pieces.at(0, 0, 0), pieces.at(0, 0, 3));
        assert_eq!(pieces.at(0, 0, 2), None);
        let mut sizes = pieces.sizes().to_vec();
        sizes.sort_unstable();
        assert_eq!(sizes, [3, 5]);
    }
}
