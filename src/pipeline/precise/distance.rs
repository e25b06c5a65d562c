//! Distance to the nearest marked cell, exact up to a limit.

use rayon::prelude::*;

/// Squared distance in cells from each cell to the nearest one for which `marked` is true, exact
/// up to `limit` (squared, too) and `u16::MAX` beyond. `shape` is `[nx, ny, nz]`, x fastest.
///
/// Separable: along each axis the least of d² + k² within the limit, so that no structure of the
/// data can make it slow.
pub(super) fn squared_distance(
    shape: [usize; 3],
    limit: u16,
    marked: impl Fn(usize) -> bool + Sync,
) -> Vec<u16> {
    let [nx, ny, nz] = shape;
    let layer = nx * ny;
    let reach = usize::from(limit.isqrt());
    let mut along_x = vec![u16::MAX; layer * nz];
    let each = along_x.par_chunks_mut(nx).enumerate();
    let known = each.map(|(row, out)| {
        let base = row * nx;
        let mut last: Option<usize> = None;
        for (x, out) in out.iter_mut().enumerate() {
            if marked(base + x) {
                last = Some(x);
            }
            if let Some(l) = last.filter(|l| x - l <= reach) {
                *out = square(x - l);
            }
        }
        let mut next: Option<usize> = None;
        for x in (0..nx).rev() {
            if out[x] == 0 {
                next = Some(x);
            }
            if let Some(n) = next.filter(|n| n - x <= reach) {
                out[x] = out[x].min(square(n - x));
            }
        }
        last.is_some()
    });
    let known: Vec<bool> = known.collect();
    let mut along_y = vec![u16::MAX; layer * nz];
    let each = along_y.par_chunks_mut(nx).enumerate();
    let known = each.map(|(row, out)| {
        let (first, y) = (row / ny * ny, row % ny);
        let near = y.saturating_sub(reach)..(y + reach + 1).min(ny);
        let rows = near.map(|v| (first + v, v.abs_diff(y))).filter(|(r, _)| known[*r]);
        lowest(out, &along_x, row, rows)
    });
    let known: Vec<bool> = known.collect();
    let mut along_z = along_x;
    along_z.par_chunks_mut(nx).enumerate().for_each(|(row, out)| {
        let (z, y) = (row / ny, row % ny);
        out.fill(u16::MAX);
        let near = z.saturating_sub(reach)..(z + reach + 1).min(nz);
        let rows = near.map(|w| (w * ny + y, w.abs_diff(z))).filter(|(r, _)| known[*r]);
        lowest(out, &along_y, row, rows);
        for v in out.iter_mut().filter(|v| **v > limit) {
            *v = u16::MAX;
        }
    });
    along_z
}

/// Lowers a row to the least of d² + k² over the rows `near` it, k away; tells whether there are any.
fn lowest(out: &mut [u16], from: &[u16], own: usize, near: impl Iterator<Item = (usize, usize)>) -> bool {
    let nx = out.len();
    let row = |r: usize| &from[r * nx..][..nx];
    if row(own).iter().all(|d| *d == 0) {
        out.fill(0);
        return true;
    }
    let mut any = false;
    for (r, away) in near {
        let offset = square(away);
        for (o, &d) in out.iter_mut().zip(row(r)) {
            *o = (*o).min(d.saturating_add(offset));
        }
        any = true;
    }
    any
}

fn square(n: usize) -> u16 {
    (n * n).min(usize::from(u16::MAX)) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_trying_all_cells() {
        let shape = [13, 9, 7];
        let marked = |i: usize| (i * 7919) % 97 == 3;
        let limit = 16;
        let found = squared_distance(shape, limit, marked);
        let at = |i: usize| [i % 13, i / 13 % 9, i / (13 * 9)];
        for i in 0..found.len() {
            let truth = (0..found.len())
                .filter(|&j| marked(j))
                .map(|j| (0..3).map(|a| at(i)[a].abs_diff(at(j)[a]).pow(2)).sum::<usize>())
                .min()
                .filter(|&d| d <= usize::from(limit))
                .map_or(u16::MAX, |d| u16::try_from(d).unwrap());
            assert_eq!(found[i], truth, "at {:?}", at(i));
        }
    }
}
