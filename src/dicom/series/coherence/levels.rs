//! The level of air and of soft tissue in bands of rows, against the slices before and after.

use super::limit::usual;
use super::{Finding, Kind, Stack};

/// Bands of rows of an image.
const BANDS: usize = 16;
/// Rows of a band at least.
const LEAST_ROWS: usize = 4;
/// Rows of a band that are looked at, about.
const ROWS: usize = 16;
/// Shares of a band's pixels that must be air, or soft tissue, in both neighbours.
const LEAST_SHARES: [f64; 2] = [1.0 / 32.0, 1.0 / 8.0];
/// Air lies below this, HU.
const AIR: i16 = -700;
/// Soft tissue lies between these, HU.
const SOFT: (i16, i16) = (-200, 300);
/// A shift of either level by this, HU, beyond what is usual, moves a border of air and tissue by less
/// than a seventh of its edge's width.
const LEAST: f64 = 150.0;
/// Air may be off by anything; soft tissue that is off by more than this, HU, is bone or air that lies in one slice alone.
const MOST: [i32; 2] = [i32::MAX, 300];
/// Air at a level as far off as this, HU, is none.
const SEVERE: f64 = 500.0;
/// Bands that make it severe.
const SEVERE_BANDS: usize = 2;

/// Around one slice and around two.
pub(super) const AROUND: [(usize, usize); 3] = [(1, 1), (1, 2), (2, 1)];

/// For each band how far air and soft tissue lie beyond both neighbours, HU.
pub(super) type Shifts = Vec<[f64; 2]>;

/// The findings among the shifts of all slices, each with one for each of [`AROUND`].
pub(super) fn find(stack: &Stack<'_>, shifts: &[[Option<Shifts>; AROUND.len()]]) -> Vec<Finding> {
    let height = height(stack.rows);
    let mut found: Vec<Finding> = Vec::new();
    for around in 0..AROUND.len() {
        let shifts = || shifts.iter().map(|of_slice| of_slice[around].as_ref());
        for (class, kind) in [Kind::Air, Kind::Tissue].into_iter().enumerate() {
            let most = |bands: &Shifts| bands.iter().map(|b| b[class]).fold(0.0, f64::max);
            let limit = LEAST + 2.0 * usual(shifts().flatten().map(most));
            for (slice, bands) in shifts().enumerate() {
                let Some(bands) = bands else { continue };
                let over: Vec<usize> = (0..bands.len()).filter(|&b| bands[b][class] > limit).collect();
                let (Some(&first), Some(&last)) = (over.first(), over.last()) else { continue };
                if found.iter().any(|f| f.slice == slice && f.kind == kind) {
                    continue;
                }
                let far = over.iter().filter(|&&b| bands[b][class] > limit.max(SEVERE)).count();
                found.push(Finding {
                    slice,
                    kind,
                    rows: first * height..stack.rows.min((last + 1) * height),
                    measured: most(bands),
                    limit,
                    severe: kind == Kind::Air && far >= SEVERE_BANDS,
                });
            }
        }
    }
    found
}

fn height(rows: usize) -> usize {
    (rows / BANDS).max(LEAST_ROWS)
}

/// A pixel, and the lower and the higher of those at its place in the neighbours.
#[derive(Clone, Copy)]
struct Pixel {
    v: i16,
    low: i16,
    high: i16,
}

impl Pixel {
    /// Whether both neighbours are of that class: air, or soft tissue.
    fn is(self, class: usize) -> bool {
        if class == 0 { self.high < AIR } else { (self.low > SOFT.0) & (self.high < SOFT.1) }
    }

    /// How far it lies beyond both neighbours.
    fn beyond(self) -> i32 {
        i32::from(self.v) - i32::from(self.v.clamp(self.low, self.high))
    }
}

/// The shifts of a slice beyond those before and after.
pub(super) fn of(own: &[i16], before: &[i16], after: &[i16], columns: usize) -> Shifts {
    let size = height(own.len() / columns) * columns;
    let bands = own.chunks(size).zip(before.chunks(size)).zip(after.chunks(size));
    bands.map(|((own, before), after)| of_band(own, before, after, columns)).collect()
}

fn of_band(own: &[i16], before: &[i16], after: &[i16], columns: usize) -> [f64; 2] {
    let step = (own.len() / columns / ROWS).max(1);
    let rows = || {
        let rows =
            own.chunks_exact(columns).zip(before.chunks_exact(columns)).zip(after.chunks_exact(columns));
        rows.step_by(step).map(|((own, before), after)| {
            let pixels = own.iter().zip(before).zip(after);
            pixels.map(|((&v, &a), &b)| Pixel { v, low: a.min(b), high: a.max(b) })
        })
    };
    let looked_at = rows().count() * columns;
    [0, 1].map(|class| {
        // Those of the class, and those of them above and below both neighbours.
        let (mut seen, mut above, mut below) = (0, 0, 0);
        for row in rows() {
            let counts = row.fold([0_u16; 3], |[seen, above, below], pixel| {
                let is = pixel.is(class);
                let (is_above, is_below) = (is & (pixel.v > pixel.high), is & (pixel.v < pixel.low));
                [seen + u16::from(is), above + u16::from(is_above), below + u16::from(is_below)]
            });
            let [of_row, above_in_row, below_in_row] = counts.map(usize::from);
            (seen, above, below) = (seen + of_row, above + above_in_row, below + below_in_row);
        }
        let enough = seen > 0 && seen as f64 >= LEAST_SHARES[class] * looked_at as f64;
        // A shift of three quarters of the pixels needs as many on one side.
        if !enough || above.max(below) + seen / 4 < seen {
            return 0.0;
        }
        let mut one_side: Vec<i32> = rows()
            .flatten()
            .filter(|pixel| pixel.is(class))
            .map(|pixel| if above >= below { pixel.beyond() } else { -pixel.beyond() })
            .filter(|&beyond| beyond > 0)
            .collect();
        shift(&mut one_side, seen, MOST[class])
    })
}

/// How far three quarters of `seen` pixels at least lie on one side of their neighbours, of which these do;
/// 0 if three quarters of them do by more than `most`.
fn shift(one_side: &mut [i32], seen: usize, most: i32) -> f64 {
    let Some(nearer) = (one_side.len() + seen / 4).checked_sub(seen) else { return 0.0 };
    if one_side.is_empty() {
        return 0.0;
    }
    let rank = nearer.min(one_side.len() - 1);
    let low = *one_side.select_nth_unstable(rank).1;
    let rank = one_side.len() * 3 / 4;
    let high = *one_side.select_nth_unstable(rank).1;
    if high > most { 0.0 } else { f64::from(low) }
}
