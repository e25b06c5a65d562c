//! How far something lies within the body: the view from it.

use super::survey::Cells;

/// How far the view goes, mm.
const VIEW_MM: f64 = 60.0;

/// The share of the 26 directions from a cell in which a ray meets the body within 60 mm, 0 to 1:
/// about a half on the outside of a face, nearly one in a sinus.
#[expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    reason = "at most 26 rays of 60 steps"
)]
pub(super) fn enclosure(cells: &Cells, cell: usize, is_body: impl Fn(usize) -> bool) -> f64 {
    let steps = (VIEW_MM / cells.edge) as isize;
    let from = cells.cell(cell);
    let met = directions().filter(|&d| (1..=steps).map_while(|n| step(cells, from, d, n)).any(&is_body));
    met.count() as f64 / 26.0
}

/// The cell `n` steps along a direction; `None` outside the survey.
fn step(cells: &Cells, from: [usize; 3], direction: [isize; 3], n: isize) -> Option<usize> {
    let mut at = [0; 3];
    for a in 0..3 {
        at[a] = from[a].checked_add_signed(direction[a] * n).filter(|&v| v < cells.shape[a])?;
    }
    Some(cells.offset(at))
}

/// The 26 directions to a cell's neighbours.
fn directions() -> impl Iterator<Item = [isize; 3]> {
    (0..27).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1]).filter(|d| *d != [0; 3])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_in_a_shell_is_enclosed_and_one_on_a_plate_is_half_so() {
        let cells = Cells { origin: [0.0; 3], edge: 1.0, shape: [41, 41, 41] };
        let distance = |i: usize| {
            cells.cell(i).iter().map(|&v| (v.abs_diff(20) * v.abs_diff(20)) as f64).sum::<f64>().sqrt()
        };
        let middle = cells.offset([20, 20, 20]);
        assert_eq!(enclosure(&cells, middle, |i| (10.0..13.0).contains(&distance(i))), 1.0);
        // Nine of the 26 directions point down.
        assert_eq!(enclosure(&cells, middle, |i| cells.cell(i)[2] < 18), 9.0 / 26.0);
    }
}
