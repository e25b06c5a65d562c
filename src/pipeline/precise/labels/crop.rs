//! Where in the scan the patient is: a wide field of view is mostly air and couch, and the fine
//! survey is for the patient.

use super::label::{Label, tissue};
use crate::geometry::Vec3;
use crate::pipeline::precise::grid::cells::Cells;
use crate::pipeline::precise::grid::pieces::Pieces;
use crate::pipeline::precise::grid::reach::within;
use crate::pipeline::precise::scan::Scan;
use crate::pipeline::precise::scan::survey::{Survey, whole};

/// Edge of the cells of the first look, mm; larger where the scan is.
const EDGE_MM: f64 = 4.0;
/// What is thicker than twice this may be the patient, mm.
const BALL_MM: f64 = 12.0;
/// A thick piece with one part in so many of the largest one's cells may be the patient's: a head
/// whose neck is thin.
const SHARE: u64 = 20;
/// Ears, nose and what hangs on the patient reach no further from what is thick, mm; and some air
/// has to be in view beside them.
const ROOM_MM: f64 = 45.0;

/// The box of the patient with some room, LPS mm, not beyond the scan and its margin; the whole
/// scan if nothing in it is thick.
pub(crate) fn bounds(scan: &Scan<'_>) -> [Vec3; 2] {
    let Scan { sampler, levels, field_of_view, .. } = scan;
    let all = whole(sampler);
    let survey = Survey::of(sampler, field_of_view, Cells::over(all, EDGE_MM));
    let cells = survey.cells;
    let labels = tissue(&survey, levels);
    let at_border =
        within(sampler.asked(), cells.shape, cells.squared(BALL_MM), |i| labels[i] != Label::Patient);
    let thick = Pieces::of(sampler.asked(), cells.shape, |i| !at_border[i]);
    let Some(main) = thick.largest() else { return all };
    let least = thick.sizes()[main as usize] / SHARE;
    let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
    thick.each_row(|[y, z], run| {
        if thick.sizes()[run.piece as usize] >= least {
            low = [low[0].min(run.start as usize), low[1].min(y), low[2].min(z)];
            high = [high[0].max(run.end as usize), high[1].max(y), high[2].max(z)];
        }
    });
    let place = |v: usize, a: usize| all[0][a] + v as f64 * cells.edge;
    [
        [0, 1, 2].map(|a| (place(low[a], a) - BALL_MM - ROOM_MM).max(all[0][a])),
        [0, 1, 2].map(|a| (place(high[a], a) + BALL_MM + ROOM_MM).min(all[1][a])),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observer::Silent;
    use crate::phantom::{Options, Phantom};
    use crate::pipeline::precise::scan::empty_ends::without_empty_ends;

    /// The neck's column runs through all slices, and what a head cut at its middle has in front of it
    /// is no wider than what there is beside a couch.
    #[test]
    fn a_head_cut_at_its_middle_is_all_in_the_box() {
        let options = Options {
            columns: 140,
            rows: 140,
            column_mm: 1.5,
            row_mm: 1.5,
            slices: 60,
            slice_mm: 2.5,
            ..Options::default()
        };
        let mut volume = Phantom::new(options).expect("the options are in range").volume();
        let grid = volume.grid.clone();
        let top = grid.lps([0, 0, 0])[2];
        let middle = {
            let (first, last) = (grid.lps([0, 0, 0]), grid.lps([59, 139, 139]));
            [0, 1].map(|a| f64::midpoint(first[a], last[a]))
        };
        for ((z, y, x), v) in volume.hu.indexed_iter_mut() {
            let p = grid.lps([z, y, x]);
            let (across, back) = (p[0] - middle[0], p[1] - middle[1]);
            let neck = across.hypot(back - 20.0) < 50.0;
            let head = across.hypot(back) < 75.0 && top - p[2] < 65.0;
            *v = if neck || head { 40 } else { -1000 } + ((x * 7 + y * 3 + z) % 11) as i16;
        }
        let slices = without_empty_ends(&volume, &Silent).expect("a volume");
        let scan = Scan::of(&slices, &Silent).expect("air and tissue");
        let [low, high] = bounds(&scan);
        for (a, reach) in [(0, 75.0), (1, 75.0)] {
            assert!(low[a] < middle[a] - reach - 10.0, "{low:?} around {middle:?}");
            assert!(high[a] > middle[a] + reach + 10.0, "{high:?} around {middle:?}");
        }
    }
}
