//! Points sorted into cubic cells, to find those near a place.

use rayon::slice::ParallelSliceMut;

use crate::observer::stop::{Asked, Stopped, unless_stopped};

/// Cells in the order z, y, x.
type Cell = [i64; 3];

/// Points sorted into the cells of a cubic grid.
///
/// A row of cells along x is one stretch of the sorted points, so that everything within one cell
/// of a place is nine stretches, found by bisection. Works for any extent: only occupied cells are
/// held.
#[derive(Debug)]
pub(crate) struct Cells {
    inverse: f64,
    cells: Vec<Cell>,
    points: Vec<[f32; 3]>,
}

impl Cells {
    /// Sorts `points` into cells of edge `edge`, mm.
    ///
    /// # Errors
    /// [`Stopped`] if it was told to stop.
    pub(crate) fn new(asked: Asked<'_>, points: &[[f32; 3]], edge: f64) -> Result<Self, Stopped> {
        unless_stopped(|| Self::sorted(asked, points, edge))
    }

    fn sorted(asked: Asked<'_>, points: &[[f32; 3]], edge: f64) -> Self {
        let inverse = 1.0 / edge;
        let placed = |(number, &point): (usize, &[f32; 3])| {
            asked.ask_at(number);
            (cell(point, inverse), point)
        };
        let mut sorted: Vec<(Cell, [f32; 3])> = points.iter().enumerate().map(placed).collect();
        // Some points, wherever they are sorted to, ask each time they are compared.
        sorted.par_sort_by(|a, b| {
            asked.ask_at(mixed(a.1));
            a.0.cmp(&b.0)
        });
        let asking = sorted.into_iter().enumerate().inspect(|(number, _)| asked.ask_at(*number));
        let (cells, points) = asking.map(|(_, both)| both).unzip();
        Self { inverse, cells, points }
    }

    /// Stretches of points that hold every point within one edge of `place`: the row of its own
    /// cell first.
    pub(crate) fn around(&self, place: [f32; 3]) -> impl Iterator<Item = &[[f32; 3]]> {
        const ROWS: [[i64; 2]; 9] =
            [[0, 0], [0, -1], [0, 1], [-1, 0], [1, 0], [-1, -1], [-1, 1], [1, -1], [1, 1]];
        let [z, y, x] = cell(place, self.inverse);
        ROWS.iter().map(move |&[dz, dy]| {
            let start = self.cells.partition_point(|&c| c < [z + dz, y + dy, x - 1]);
            let length = self.cells[start..].partition_point(|&c| c <= [z + dz, y + dy, x + 1]);
            &self.points[start..start + length]
        })
    }
}

/// A number without a pattern for a place.
fn mixed(place: [f32; 3]) -> usize {
    let [x, y, z] = place.map(|v| u64::from(v.to_bits()));
    let mixed = (x ^ y.rotate_left(21) ^ z.rotate_left(42)).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40;
    usize::try_from(mixed).unwrap_or_default()
}

/// Cells end here; what lies beyond shares the last one.
const LAST: f64 = (1_u64 << 40) as f64;

#[expect(clippy::cast_possible_truncation, reason = "within LAST")]
fn cell(point: [f32; 3], inverse: f64) -> Cell {
    [2, 1, 0].map(|axis| (f64::from(point[axis]) * inverse).floor().clamp(-LAST, LAST) as i64)
}

/// Squared distance in single precision, as PCL's search trees compute it.
pub(crate) fn squared_distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    x * x + y * y + z * z
}
