//! What the phantom says of itself is so: without that, it can judge nothing.

use triplanar::dicom::series::{ReadLimits, read};
use triplanar::geometry::{add, norm, scale, sub};
use triplanar::observer::Silent;
use triplanar::phantom::{Options, Phantom};

use crate::support::instances::InMemory;

fn small() -> Options {
    Options {
        columns: 256,
        rows: 240,
        column_mm: 0.9,
        row_mm: 0.95,
        slices: 60,
        slice_mm: 2.5,
        ..Options::default()
    }
}

#[test]
fn the_files_hold_the_volume_in_place() {
    for options in [small(), Options { tilt_deg: -13.0, slices: 20, ..small() }] {
        let phantom = Phantom::new(options).expect("valid options");
        let files = phantom.instances().into_iter().map(|(_, bytes)| bytes).collect();
        let (volume, _) = read(&InMemory(files), &ReadLimits::default(), &Silent).expect("a volume");
        let expected = phantom.volume();
        assert!(volume.hu == expected.hu, "voxels");
        assert_eq!(volume.identity, expected.identity);
        assert_eq!(volume.sop_instance_uids, expected.sop_instance_uids);
        let last = expected.grid.shape().map(|n| n - 1);
        for corner in [[0; 3], last, [last[0], 0, 0], [0, last[1], 0], [0, 0, last[2]]] {
            let off = norm(sub(volume.grid.lps(corner), expected.grid.lps(corner)));
            assert!(off < 1e-6, "voxel {corner:?} is {off} mm off");
        }
    }
}

#[test]
fn no_patient_is_in_it_but_the_phantom() {
    let phantom = Phantom::new(Options { slices: 2, ..small() }).expect("valid options");
    let (uid, bytes) = &phantom.instances()[0];
    let object = dicom_object::from_reader(&bytes[..]).expect("DICOM");
    let text = |tag| object.element(tag).expect("present").to_str().expect("text").trim().to_owned();
    use dicom_dictionary_std::tags;
    assert_eq!(text(tags::PATIENT_NAME), "PHANTOM^1");
    assert_eq!(text(tags::SOP_INSTANCE_UID), uid.as_str());
    assert!(uid.as_str().starts_with("2.25."), "{uid}");
}

/// The edge of the head in a fine, noiseless scan, half-way between air and skin, is where the
/// skin is said to be.
#[test]
fn the_half_way_surface_of_a_noiseless_scan_is_the_true_skin() {
    let options = Options {
        columns: 400,
        rows: 460,
        column_mm: 0.5,
        row_mm: 0.5,
        slices: 3,
        slice_mm: 0.5,
        top_mm: -30.0,
        noise_hu: 0.0,
        holder: false,
        pitch_deg: 6.0,
        yaw_deg: -9.0,
        ..Options::default()
    };
    let phantom = Phantom::new(options).expect("valid options");
    let volume = phantom.volume();
    let half_way = (30.0 - 1000.0) / 2.0;
    let (mut sum, mut count) = (0.0, 0.0);
    for y in 0..460 {
        // From outside to the first crossing, on both sides.
        let row = |x: usize| f64::from(volume.hu[[1, y, x]]);
        let from_left = (1..400).find(|&x| row(x) > half_way).map(|x| (x - 1, x));
        let from_right = (0..399).rev().find(|&x| row(x) > half_way).map(|x| (x + 1, x));
        for (outside, inside) in from_left.into_iter().chain(from_right) {
            let (a, b) = (volume.grid.lps([1, y, outside]), volume.grid.lps([1, y, inside]));
            let share = (half_way - row(outside)) / (row(inside) - row(outside));
            let off = phantom.signed_distance(add(a, scale(sub(b, a), share)));
            assert!(off.abs() < 0.25, "row {y}: {off} mm off the skin");
            sum += off;
            count += 1.0;
        }
    }
    assert!(count > 500.0 && (sum / count).abs() < 0.02, "{count} crossings, mean {} mm", sum / count);
}

#[test]
fn skin_points_lie_on_the_skin_inside_the_scan_and_everywhere() {
    let phantom = Phantom::new(Options { roll_deg: 5.0, tilt_deg: 10.0, ..small() }).expect("valid options");
    let points = phantom.skin_points(2.0);
    let grid = phantom.grid();
    let (top, bottom) = (grid.lps([0; 3])[2], grid.lps([59, 0, 0])[2]);
    assert!(points.iter().all(|p| phantom.signed_distance(*p).abs() < 0.01), "off the skin");
    assert!(points.iter().all(|p| p[2] < top + 45.0 && p[2] > bottom - 45.0), "outside the scan");
    // A head's skin down to the chin is some 100 000 mm², a cell of 2 mm about 4 mm² (a little less).
    assert!((15_000..40_000).contains(&points.len()), "{} points", points.len());
}
