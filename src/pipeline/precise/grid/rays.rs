//! How far something lies within the body: the view from it.

use super::cells::Cells;

/// How far the view goes, mm.
const VIEW_MM: f64 = 60.0;
/// How far the view for a brain's shell goes, mm.
const FAR_MM: f64 = 160.0;

/// What a ray meets in a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Seen {
    /// What it looks for.
    Wanted,
    /// Something else: it goes on.
    Other,
    /// The end of the scan.
    Nothing,
}

/// The share of the 26 directions from a cell in which a ray meets the body within 60 mm, 0 to 1:
/// about a half on the outside of a face, nearly one in a sinus.
pub(crate) fn enclosure(cells: &Cells, cell: usize, is_body: impl Fn(usize) -> bool) -> f64 {
    let met = directions().filter(|&d| ray(cells, cell, d, VIEW_MM).0.any(&is_body));
    met.count() as f64 / 26.0
}

/// In how many of the 26 directions a ray meets what it looks for, and how many do not leave the
/// scan before.
pub(crate) fn view(cells: &Cells, cell: usize, look: impl Fn(usize) -> Seen) -> (usize, usize) {
    let (mut met, mut ended) = (0, 0);
    for direction in directions() {
        let (mut ray, leaves) = ray(cells, cell, direction, FAR_MM);
        let end = if leaves { Seen::Nothing } else { Seen::Other };
        let first = ray.by_ref().map(&look).find(|seen| *seen != Seen::Other).unwrap_or(end);
        met += usize::from(first == Seen::Wanted);
        ended += usize::from(first != Seen::Nothing);
    }
    (met, ended)
}

/// The cells along a direction from a cell, so many steps of a cell's edge as make `mm`; and
/// whether the survey ends before.
pub(crate) fn ray(
    cells: &Cells,
    from: usize,
    direction: [isize; 3],
    mm: f64,
) -> (impl Iterator<Item = usize>, bool) {
    let (at, [nx, ny, _]) = (cells.cell(from), cells.shape);
    let room = (0..3).map(|a| match direction[a] {
        0 => usize::MAX,
        1.. => cells.shape[a] - 1 - at[a],
        _ => at[a],
    });
    let room = room.min().unwrap_or(0);
    let steps = (mm / cells.edge) as usize;
    let stride = direction[0] + (direction[1] + direction[2] * ny as isize) * nx as isize;
    let cell = move |n: usize| from.wrapping_add_signed(stride * n as isize);
    ((1..=room.min(steps)).map(cell), room < steps)
}

/// The 26 directions to a cell's neighbours; the last is the opposite of the first, and so on.
pub(crate) fn directions() -> impl Iterator<Item = [isize; 3]> {
    (0..27).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1]).filter(|d| *d != [0; 3])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::precise::grid::index::Cell;

    #[test]
    fn a_cell_in_a_shell_is_enclosed_and_one_on_a_plate_is_half_so() {
        let cells = Cells { origin: [0.0; 3], edge: 1.0, shape: [41, 41, 41] };
        let distance = |i: usize| {
            cells.cell(i).0.iter().map(|&v| (v.abs_diff(20) * v.abs_diff(20)) as f64).sum::<f64>().sqrt()
        };
        let middle = cells.offset(Cell([20, 20, 20]));
        assert_eq!(enclosure(&cells, middle, |i| (10.0..13.0).contains(&distance(i))), 1.0);
        // Nine of the 26 directions point down.
        assert_eq!(enclosure(&cells, middle, |i| cells.cell(i)[2] < 18), 9.0 / 26.0);
    }
}
