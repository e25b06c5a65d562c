//! The ray test against the even–odd test of single points, and the carried area.

use proptest::prelude::*;

use super::four_direction::Crossings;
use super::{CarriedArea, Findings, Measures};
use crate::pipeline::paper::contour::{external_contours, polygon};
use crate::pipeline::slices::Pixel;
use crate::pipeline::{Bitmap, Reason, Rejection, Thresholds};

/// Whether a position lies strictly outside: a ray to the right crosses an even number of edges,
/// and the position lies on none.
fn is_outside_twin(pixels: &[Pixel], x: f64, y: f64) -> bool {
    let mut crossings = 0;
    for (p, q) in polygon::edges(pixels) {
        let [px, py, qx, qy] = [p.column, p.row, q.column, q.row].map(f64::from);
        let side = (qx - px) * (y - py) - (qy - py) * (x - px);
        let in_box = px.min(qx) <= x && x <= px.max(qx) && py.min(qy) <= y && y <= py.max(qy);
        if side == 0.0 && in_box {
            return false;
        }
        if (py > y) != (qy > y) && x < px + (y - py) * (qx - px) / (qy - py) {
            crossings += 1;
        }
    }
    crossings % 2 == 0
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn a_ray_leaves_the_contour_where_the_even_odd_test_says_so(
        white in prop::collection::vec(any::<bool>(), 12 * 12),
        // Halves, so that rays pass through corners and along edges.
        at in (0..24_u8).prop_map(|v| f32::from(v) * 0.5),
        first_row in 0..2_u32,
    ) {
        let mut bitmap = Bitmap::new(12, 12);
        for index in (0..white.len()).filter(|&i| white[i]) {
            bitmap.set_white(index / 12, index % 12);
        }
        for mut contour in external_contours(&mut bitmap) {
            contour.retain(|p| p.row >= first_row);
            let vertical = Crossings::of(&contour, at, |p| (p.column, p.row));
            let horizontal = Crossings::of(&contour, at, |p| (p.row, p.column));
            for position in 0..12_usize {
                let along = position as f64;
                let at = f64::from(at);
                prop_assert_eq!(vertical.is_outside(position), is_outside_twin(&contour, at, along));
                prop_assert_eq!(horizontal.is_outside(position), is_outside_twin(&contour, along, at));
            }
        }
    }
}

fn findings(area: f64, solidity: f64) -> Findings {
    Findings { measures: Measures { area, solidity }, before: None, on_jump: None, after: None }
}

#[test]
fn the_carried_area_is_kept_by_a_rejection_after_a_jump_and_moved_by_a_later_one() {
    let thresholds = Thresholds::default();
    let mut carried = CarriedArea::default();
    assert_eq!(carried.decide(&findings(20_000.0, 0.9), &thresholds), None);
    assert_eq!(carried, CarriedArea(Some(20_000.0)));

    let jump = carried.decide(&findings(110_000.0, 0.9), &thresholds);
    let expected = Rejection { reason: Reason::AreaJump80000, measured: 90_000.0, limit: 80_000.0 };
    assert_eq!(jump, Some(expected));
    assert_eq!(carried, CarriedArea(Some(20_000.0)), "a slice that jumped is not compared with");

    let after = Rejection { reason: Reason::LastRow, measured: 3.0, limit: 0.0 };
    let late = Findings { after: Some(after), ..findings(25_000.0, 0.9) };
    assert_eq!(carried.decide(&late, &thresholds), Some(after));
    assert_eq!(carried, CarriedArea(Some(25_000.0)), "tests after the jump come after the comparison");
}

#[test]
fn a_first_slice_that_is_rejected_starts_the_carried_area_all_the_same() {
    let mut carried = CarriedArea::default();
    let before = Rejection { reason: Reason::Solidity, measured: 0.5, limit: 0.88 };
    let first = Findings { before: Some(before), ..findings(50_000.0, 0.5) };
    assert_eq!(carried.decide(&first, &Thresholds::default()), Some(before));
    assert_eq!(carried, CarriedArea(Some(50_000.0)));
}

#[test]
fn after_a_jump_a_ragged_contour_and_one_larger_than_a_head_are_rejected() {
    let thresholds = Thresholds::default();
    let reason = |area, solidity| {
        let mut carried = CarriedArea(Some(60_000.0));
        carried.decide(&findings(area, solidity), &thresholds).map(|rejection| rejection.reason)
    };
    assert_eq!(reason(69_000.0, 0.74), Some(Reason::Solidity075));
    assert_eq!(reason(67_000.0, 0.74), None, "no jump");
    assert_eq!(reason(121_000.0, 0.9), Some(Reason::AreaOver120000));
    assert_eq!(reason(181_000.0, 0.9), None, "a jump of 120000 and more passes unchecked");
}
