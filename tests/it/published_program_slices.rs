//! `paper` decides on every slice as the published program does.

use triplanar::geometry::Plane;
use triplanar::observer::Silent;
use triplanar::pipeline::paper::decisions::{Decisions, decide};
use triplanar::pipeline::slices::Pixel;
use triplanar::pipeline::{Parameters, SliceRow};

use crate::support::published::{Published, SERIES, Slice};
use crate::support::{data, instances};

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn every_slice_is_decided_as_by_the_published_program() {
    let data = data::dir();
    for name in SERIES {
        let volume = instances::volume(&data, name);
        let decisions = decide(&volume.hu, &Parameters::paper(), &Silent).expect("nobody cancels");
        let differences = differences(&decisions, &Published::of(&data, name));
        assert!(
            differences.is_empty(),
            "{name}: {} of {} slices differ from the published program's: {}",
            differences.len(),
            decisions.rows.len(),
            differences.iter().take(10).map(String::as_str).collect::<Vec<_>>().join("; ")
        );
    }
}

/// What differs, a line a slice.
fn differences(decisions: &Decisions, published: &Published) -> Vec<String> {
    let theirs = published.slices();
    let their_contours = published.contours();
    assert_eq!(decisions.rows.len(), theirs.len(), "a row for every slice");
    let mut differences = Vec::new();
    for ((our_row, our_contour), their_row) in decisions.rows.iter().zip(&decisions.contours).zip(&theirs) {
        let our = told(our_row);
        let no_contour = Vec::new();
        let their_contour = their_contours.get(&(our.plane, our.index)).unwrap_or(&no_contour);
        if !is_equal(&our, their_row) {
            differences.push(format!("{our:?}, theirs {their_row:?}"));
        } else if sorted(our_contour) != sorted(their_contour) {
            differences.push(format!("{:?} {}: other contour pixels", our.plane, our.index));
        }
    }
    differences
}

/// Our decision, as the published program tells its own.
pub(crate) fn told(row: &SliceRow) -> Slice {
    Slice {
        plane: row.plane,
        index: row.index,
        accepted: row.rejection.is_none(),
        reason: row.rejection.map_or(String::new(), |r| r.reason.name().to_owned()),
        contour_points: row.contour_points,
        contour_area: row.contour_area,
        solidity: row.solidity,
        carried_area_before: row.carried_area.0,
        carried_area_after: row.carried_area.1,
    }
}

/// The carried area counts where there is a contour to compare with; elsewhere the program prints
/// what the plane before has left behind.
pub(crate) fn is_equal(our: &Slice, their: &Slice) -> bool {
    let close = |a: Option<f64>, b: Option<f64>| match (a, b) {
        (Some(a), Some(b)) => (a - b).abs() <= 1e-9 * b.abs(),
        (a, b) => a.is_none() && b.is_none(),
    };
    (our.plane, our.index, our.accepted, &our.reason, our.contour_points)
        == (their.plane, their.index, their.accepted, &their.reason, their.contour_points)
        && close(our.contour_area, their.contour_area)
        && close(our.solidity, their.solidity)
        && (our.contour_area.is_none()
            || close(our.carried_area_before, their.carried_area_before)
                && close(our.carried_area_after, their.carried_area_after))
}

/// The set of pixels; the program lists a pixel as often as its border passes it, as we do.
pub(crate) fn sorted(contour: &[Pixel]) -> Vec<Pixel> {
    let mut pixels = contour.to_vec();
    pixels.sort_unstable();
    pixels
}

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn the_published_results_hold_accepted_and_rejected_slices_of_every_plane() {
    let data = data::dir();
    for plane in Plane::ALL {
        let of_plane: Vec<Slice> = SERIES
            .iter()
            .flat_map(|name| Published::of(&data, name).slices())
            .filter(|slice| slice.plane == plane)
            .collect();
        assert!(of_plane.iter().any(|s| s.accepted) && of_plane.iter().any(|s| !s.accepted), "{plane:?}");
    }
}
