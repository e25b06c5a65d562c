//! Series → volume: true place, the named errors, the warnings.

use std::path::Path;

use triplanar::dicom::Volume;
use triplanar::dicom::series::{self, ReadLimits, SeriesError, Warning, WarningCode};
use triplanar::dicom::uid::SopInstanceUid;
use triplanar::geometry::Axis;
use triplanar::observer::{Observer, Silent, Stage};

use crate::support::data;
use crate::support::dicom::{CT, DataSet, ENHANCED_CT, EXPLICIT, Memory, Slice, identity};

/// So few slices only in these tests.
const LIMITS: fn() -> ReadLimits = || ReadLimits { min_slices: 3, ..ReadLimits::default() };

fn read(files: Vec<Vec<u8>>) -> Result<(Volume, Vec<Warning>), SeriesError> {
    series::read(&Memory(files), &LIMITS(), &Silent)
}

fn codes(warnings: &[Warning]) -> Vec<WarningCode> {
    warnings.iter().map(|warning| warning.code).collect()
}

// ---- a small head, acquired in many ways ----

const SHAPE: [usize; 3] = [5, 6, 7];
const SPACING: [f64; 3] = [2.0, 1.25, 1.5];
/// LPS of the voxel at 0, 0, 0: most superior, posterior, right.
const ORIGIN: [f64; 3] = [-31.5, 40.25, 812.75];

fn hu(z: usize, y: usize, x: usize) -> i16 {
    i16::try_from(z * 100 + y * 10 + x).expect("small") - 250
}

fn lps(z: usize, y: usize, x: usize) -> [f64; 3] {
    [ORIGIN[0] + x as f64 * SPACING[2], ORIGIN[1] - y as f64 * SPACING[1], ORIGIN[2] - z as f64 * SPACING[0]]
}

/// LPS unit vector of increasing index on axis z, y, x.
const WAY: [[f64; 3]; 3] = [[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]];

/// The slices of an acquisition whose slices, rows and columns run along these axes (0 z, 1 y,
/// 2 x), backwards where flipped.
fn acquired(axes: [usize; 3], flipped: [bool; 3]) -> Vec<Slice> {
    let index = |scan: usize, i: usize| if flipped[scan] { SHAPE[axes[scan]] - 1 - i } else { i };
    let direction = |scan: usize| WAY[axes[scan]].map(|d| if flipped[scan] { -d } else { d });
    let voxel = |s: usize, r: usize, c: usize| {
        let mut at = [0; 3];
        at[axes[0]] = index(0, s);
        at[axes[1]] = index(1, r);
        at[axes[2]] = index(2, c);
        at
    };
    (0..SHAPE[axes[0]])
        .map(|s| {
            let [z, y, x] = voxel(s, 0, 0);
            let [row, column] = [direction(2), direction(1)];
            let mut values = Vec::new();
            for r in 0..SHAPE[axes[1]] {
                for c in 0..SHAPE[axes[2]] {
                    let [z, y, x] = voxel(s, r, c);
                    values.push(hu(z, y, x) - Slice::INTERCEPT);
                }
            }
            Slice {
                uid: format!("1.2.3.4.{}", s + 1),
                position: lps(z, y, x),
                orientation: [row[0], row[1], row[2], column[0], column[1], column[2]],
                spacing: [SPACING[axes[1]], SPACING[axes[2]]],
                rows: u16::try_from(SHAPE[axes[1]]).expect("small"),
                columns: u16::try_from(SHAPE[axes[2]]).expect("small"),
                values,
            }
        })
        .collect()
}

/// Axial, supine, head first, from the feet up: rows to the back, columns to the left.
fn usual() -> Vec<Slice> {
    acquired([0, 1, 2], [true, true, false])
}

fn files(slices: &[Slice]) -> Vec<Vec<u8>> {
    slices.iter().map(Slice::part10).collect()
}

fn assert_is_the_head(volume: &Volume, what: &str) {
    assert_eq!(volume.hu.dim(), (5, 6, 7), "{what}");
    assert_eq!(volume.grid.shape(), SHAPE, "{what}");
    for ((z, y, x), value) in volume.hu.indexed_iter() {
        assert_eq!(*value, hu(z, y, x), "{what}: voxel {z} {y} {x}");
        let (is, should) = (volume.grid.lps([z, y, x]), lps(z, y, x));
        let off = is.iter().zip(should).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-6, "{what}: voxel {z} {y} {x} is at {is:?} instead of {should:?}");
    }
    assert!(volume.hu.is_standard_layout(), "{what}");
}

#[test]
fn every_way_to_acquire_a_head_gives_the_same_voxels_at_the_same_place() {
    let permutations = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    for axes in permutations {
        for bits in 0..8 {
            let flipped = [bits & 1 != 0, bits & 2 != 0, bits & 4 != 0];
            let what = format!("axes {axes:?} flipped {flipped:?}");
            let (volume, warnings) =
                read(files(&acquired(axes, flipped))).unwrap_or_else(|e| panic!("{what}: {e}"));
            assert_is_the_head(&volume, &what);
            assert_eq!(volume.grid.slice_axis() as usize, axes[0], "{what}");
            let is_usual = axes == [0, 1, 2] && flipped[1] && !flipped[2];
            assert_eq!(codes(&warnings).contains(&WarningCode::Reoriented), !is_usual, "{what}");
            let slices = volume.sop_instance_uids.len();
            assert_eq!(slices, SHAPE[axes[0]], "{what}");
            // The instance of the first slice of the volume is the last one if the scan ran backwards.
            let first = if flipped[0] { slices } else { 1 };
            assert_eq!(volume.sop_instance_uids[0].as_str(), format!("1.2.3.4.{first}"), "{what}");
        }
    }
}

#[test]
fn the_order_of_the_files_does_not_count() {
    let mut slices = files(&usual());
    slices.swap(0, 3);
    slices.swap(2, 4);
    let (volume, warnings) = read(slices).expect("a volume");
    assert_is_the_head(&volume, "shuffled");
    assert_eq!(codes(&warnings), [WarningCode::AnisotropicPixels, WarningCode::UnusualMatrix]);
    assert_eq!(volume.identity.series_instance_uid.as_str(), "1.2.3.2");
    assert_eq!(volume.identity.study_instance_uid.expect("the study").as_str(), "1.2.3.1");
    assert_eq!(volume.identity.frame_of_reference_uid.expect("the frame").as_str(), "1.2.3.3");
}

#[test]
fn a_tilted_gantry_shears_the_grid_and_nothing_else() {
    // Slices tilted by 20 degrees about x, moved straight up along z.
    let (sin, cos) = 20_f64.to_radians().sin_cos();
    let mut slices = usual();
    for (index, slice) in slices.iter_mut().enumerate() {
        slice.position = [-31.5, 34.0, 700.0 + 2.5 * index as f64];
        slice.orientation = [1.0, 0.0, 0.0, 0.0, cos, -sin];
    }
    let expected = slices.clone();
    let (volume, warnings) = read(files(&slices)).expect("a volume");
    let tilt = warnings.iter().find(|warning| warning.code == WarningCode::GantryTilt).expect("a warning");
    assert!(tilt.detail.contains("20.00 degrees"), "{}", tilt.detail);
    for ((z, y, x), value) in volume.hu.indexed_iter() {
        assert_eq!(*value, hu(z, y, x));
        let (row, position) = ((5 - y) as f64 * SPACING[1], expected[4 - z].position);
        let should = [position[0] + x as f64 * SPACING[2], position[1] + row * cos, position[2] - row * sin];
        let is = volume.grid.lps([z, y, x]);
        assert!(is.iter().zip(should).all(|(a, b)| (a - b).abs() < 1e-3), "{is:?} instead of {should:?}");
    }
}

#[test]
fn an_oblique_scan_keeps_its_true_place() {
    // The usual scan, turned by 12 degrees about z.
    let (sin, cos) = 12_f64.to_radians().sin_cos();
    let turn = |v: [f64; 3]| [cos * v[0] - sin * v[1], sin * v[0] + cos * v[1], v[2]];
    let mut slices = usual();
    for slice in &mut slices {
        slice.position = turn(slice.position);
        let [a, b, c, d, e, f] = slice.orientation;
        let (row, column) = (turn([a, b, c]), turn([d, e, f]));
        slice.orientation = [row[0], row[1], row[2], column[0], column[1], column[2]];
    }
    let (volume, warnings) = read(files(&slices)).expect("a volume");
    assert!(codes(&warnings).contains(&WarningCode::Oblique));
    assert!(!codes(&warnings).contains(&WarningCode::GantryTilt));
    for ((z, y, x), value) in volume.hu.indexed_iter() {
        assert_eq!(*value, hu(z, y, x));
        let (is, should) = (volume.grid.lps([z, y, x]), turn(lps(z, y, x)));
        assert!(is.iter().zip(should).all(|(a, b)| (a - b).abs() < 1e-3), "{is:?} instead of {should:?}");
    }
}

// ---- the named errors ----

fn uids(of: &[&str]) -> Vec<SopInstanceUid> {
    of.iter().map(|uid| uid.parse().expect("a UID")).collect()
}

fn refused(slices: Vec<Vec<u8>>, code: &str, instances: &[&str]) {
    let error = read(slices).expect_err(code);
    assert_eq!((error.code(), error.instances()), (code, &uids(instances)[..]), "{error}");
}

/// The usual slices with one changed.
fn with(index: usize, change: impl Fn(&mut Slice)) -> Vec<Vec<u8>> {
    let mut slices = usual();
    change(&mut slices[index]);
    files(&slices)
}

/// The usual slices, one of them with an element replaced by another (of the same length).
fn patched(index: usize, from: &[u8], to: &[u8]) -> Vec<Vec<u8>> {
    let mut slices = files(&usual());
    let file = &mut slices[index];
    let at = file.windows(from.len()).position(|bytes| bytes == from).expect("the element");
    file[at..at + to.len()].copy_from_slice(to);
    slices
}

#[test]
fn what_is_no_volume_is_refused_and_the_odd_ones_are_named() {
    refused(with(1, |slice| slice.orientation[1] = 0.0005), "mixed_orientation", &["1.2.3.4.2"]);
    refused(with(2, |slice| slice.spacing = [1.25, 1.501]), "mixed_pixel_spacing", &["1.2.3.4.3"]);
    let other_matrix = |slice: &mut Slice| {
        slice.rows = 7;
        slice.columns = 6;
    };
    refused(with(3, other_matrix), "mixed_matrix", &["1.2.3.4.4"]);
    refused(patched(4, b"1.2.3.3", b"1.2.3.9"), "mixed_frame_of_reference", &["1.2.3.4.5"]);
    refused(patched(4, b"1.2.3.2", b"1.2.3.9"), "mixed_series", &["1.2.3.4.5"]);
    refused(with(2, |slice| slice.position[2] -= 2.0), "duplicate_position", &["1.2.3.4.2", "1.2.3.4.3"]);
    refused(patched(0, b"MONOCHROME2", b"MONOCHROME3"), "unknown_photometric", &["1.2.3.4.1"]);
    // Another tag hides the element.
    refused(patched(0, &[0x28, 0, 0x53, 0x10], &[0x28, 0, 0x5F, 0x10]), "no_rescale", &["1.2.3.4.1"]);
    refused(patched(0, &[0x28, 0, 0x30, 0], &[0x28, 0, 0x3F, 0]), "missing_geometry", &["1.2.3.4.1"]);
    refused(patched(0, &[0x20, 0, 0x32, 0], &[0x20, 0, 0x3F, 0]), "missing_geometry", &["1.2.3.4.1"]);
    let two = usual()[..2].to_vec();
    refused(files(&two), "too_few_slices", &["1.2.3.4.1", "1.2.3.4.2"]);
    let without_pixels = identity(CT, "1.2.3.4.9").part10(CT, "1.2.3.4.9", EXPLICIT);
    refused(vec![without_pixels.clone()], "no_pixel_data", &["1.2.3.4.9"]);
    refused(Vec::new(), "no_pixel_data", &[]);
    refused(
        patched(1, b"CS\x02\0CT", b"CS\x02\0MR"),
        "missing_slice",
        &["1.2.3.4.1", "1.2.3.4.2", "1.2.3.4.3"],
    );
    let mut cut = files(&usual());
    cut[3].truncate(300);
    assert_eq!(read(cut).expect_err("cut off").code(), "malformed");
}

/// Instances of ten usual slices, each moved as told.
fn ten(moved: impl Fn(usize, &mut Slice)) -> Vec<Vec<u8>> {
    let slice = |index: usize| {
        let mut slice = usual().swap_remove(0);
        slice.uid = format!("1.2.3.4.{:02}", index + 10);
        slice.position[2] += 2.0 * index as f64;
        slice.values[0] = i16::try_from(index).expect("few");
        moved(index, &mut slice);
        slice.part10()
    };
    (0..10).map(slice).collect()
}

#[test]
fn a_place_that_cannot_be_is_refused() {
    let all: Vec<String> = (10..20).map(|number| format!("1.2.3.4.{number}")).collect();
    let all: Vec<&str> = all.iter().map(String::as_str).collect();
    for axis in 0..3 {
        for far in [1e6, -10_000.1, 1e30] {
            let moved = |index, slice: &mut Slice| {
                if index == 4 {
                    slice.position[axis] = far;
                }
            };
            refused(ten(moved), "implausible_geometry", &["1.2.3.4.14"]);
        }
    }
    refused(ten(|_, slice| slice.position[0] = 1e30), "implausible_geometry", &all);
    for spacing in [[1e20, 1e20], [0.001, 1.25], [1.25, 10.5]] {
        refused(ten(|_, slice| slice.spacing = spacing), "implausible_geometry", &all);
    }
    // Directions that are no unit vectors, or not at a right angle, would stretch or skew the head.
    refused(ten(|_, slice| slice.orientation[0] = 1.005), "missing_geometry", &all);
    refused(ten(|_, slice| slice.orientation[1] = 0.005), "missing_geometry", &all);
    assert!(read(ten(|_, slice| slice.position[0] += 5_000.0)).is_ok());
}

#[test]
fn directions_of_not_quite_unit_length_do_not_stretch_the_head() {
    let (volume, _) = read(ten(|_, slice| slice.orientation[0] = 1.0009)).expect("a volume");
    let [first, last] = [0, 6].map(|x| volume.grid.lps([0, 0, x]));
    assert!((last[0] - first[0] - 6.0 * SPACING[2]).abs() < 1e-9, "{first:?} {last:?}");
}

#[test]
fn a_slice_beside_the_line_of_the_others_is_refused_and_named() {
    // Upright and tilted: the positions go sideways by so many mm a slice.
    for drift in [0.0, 0.7] {
        let ten = |moved: &dyn Fn(usize, &mut Slice)| {
            ten(|index, slice| {
                slice.position[1] += drift * index as f64;
                moved(index, slice);
            })
        };
        for odd in [0, 1, 4, 5, 9] {
            let uid = format!("1.2.3.4.{}", odd + 10);
            for (axis, off) in [(0, 20.0), (0, -0.6), (1, 0.6), (1, -500.0)] {
                let moved = |index, slice: &mut Slice| {
                    if index == odd {
                        slice.position[axis] += off;
                    }
                };
                refused(ten(&moved), "inconsistent_position", &[&uid]);
            }
        }
        // The patient was moved after six slices.
        let moved = |index, slice: &mut Slice| {
            if index > 5 {
                slice.position[0] += 50.0;
            }
        };
        let last = ["1.2.3.4.16", "1.2.3.4.17", "1.2.3.4.18", "1.2.3.4.19"];
        refused(ten(&moved), "inconsistent_position", &last);
        // Positions that are rounded to 0.1 mm are no other place.
        let rounded =
            |_, slice: &mut Slice| slice.position = slice.position.map(|x| (x * 10.0).round() / 10.0);
        assert!(read(ten(&rounded)).is_ok());
    }
    let three = usual().into_iter().take(3).enumerate().map(|(index, mut slice)| {
        slice.position[0] += if index == 1 { 20.0 } else { 0.0 };
        slice.part10()
    });
    refused(three.collect(), "inconsistent_position", &["1.2.3.4.2"]);
}

#[test]
fn more_tilt_than_a_gantry_has_is_refused() {
    let leaning = |degrees: f64| {
        ten(move |index, slice| slice.position[1] += 2.0 * index as f64 * degrees.to_radians().tan())
    };
    assert!(read(leaning(44.9)).is_ok());
    let error = read(leaning(45.1)).expect_err("too much");
    assert_eq!((error.code(), error.instances().len()), ("excessive_tilt", 10), "{error}");
    assert!(error.to_string().contains("45.10 degrees"), "{error}");
}

#[test]
fn an_instance_that_is_no_slice_is_named_with_its_reason() {
    // Another tag hides the pixels.
    let hidden = |index: usize| patched(index, &[0xE0, 0x7F, 0x10, 0], &[0xE0, 0x7F, 0x12, 0]);
    refused(hidden(2), "no_pixel_data", &["1.2.3.4.3"]);
    let ignored = |files: Vec<Vec<u8>>| {
        let (volume, mut warnings) = read(files).expect("a volume");
        assert_eq!(volume.hu.dim().0, 4);
        warnings.retain(|warning| warning.code == WarningCode::IgnoredInstances);
        assert_eq!(warnings.len(), 1);
        let named = |one: &series::IgnoredInstance| (one.sop_instance_uid.to_string(), one.reason.name());
        warnings[0].instances.iter().map(named).collect::<Vec<_>>()
    };
    assert_eq!(ignored(hidden(0)), [("1.2.3.4.1".to_owned(), "no_pixel_data")]);
    let dose = patched(4, b"ORIGINAL\\PRIMARY\\AXIAL", b"DERIVED\\SEC\\DOSE_INFO ");
    assert_eq!(ignored(dose), [("1.2.3.4.5".to_owned(), "secondary_capture")]);
    let mr = patched(4, b"CS\x02\0CT", b"CS\x02\0MR");
    assert_eq!(ignored(mr), [("1.2.3.4.5".to_owned(), "not_ct")]);
    let localizer = b"ORIGINAL\\PRI\\LOCALIZER";
    refused(
        patched(2, b"ORIGINAL\\PRIMARY\\AXIAL", localizer),
        "missing_slice",
        &["1.2.3.4.2", "1.2.3.4.3", "1.2.3.4.4"],
    );
}

#[test]
fn a_volume_beyond_the_limit_is_refused_before_it_is_decoded() {
    let limits = ReadLimits { max_voxels: 5 * 6 * 7 - 1, ..LIMITS() };
    let error = series::read(&Memory(files(&usual())), &limits, &Silent).expect_err("one voxel too many");
    assert_eq!(error.code(), "too_large");
    assert!(error.to_string().contains("jobs.max_voxels"));
}

#[test]
fn a_cancelled_reading_stops() {
    struct Cancel;
    impl Observer for Cancel {
        fn progress(&self, _: Stage, _: f64) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    let error = series::read(&Memory(files(&usual())), &LIMITS(), &Cancel).expect_err("cancelled");
    assert_eq!(error.code(), "cancelled");
}

/// Reads axial slices at these heights.
fn at_heights(heights: &[f64]) -> Result<(Volume, Vec<Warning>), SeriesError> {
    let mut slices = Vec::new();
    for (index, height) in heights.iter().enumerate() {
        let mut slice = usual().swap_remove(0);
        slice.uid = format!("1.2.3.4.{}", index + 1);
        slice.position[2] = *height;
        slice.values[0] = i16::try_from(index).expect("few");
        slices.push(slice);
    }
    read(files(&slices))
}

/// Heights from the steps between them.
fn steps(steps: &[(usize, f64)]) -> Vec<f64> {
    let mut heights = vec![-40.0];
    for (count, step) in steps {
        for _ in 0..*count {
            heights.push(heights[heights.len() - 1] + step);
        }
    }
    heights
}

#[test]
fn a_hole_is_refused_and_a_protocol_with_two_spacings_is_not() {
    for hole in [
        vec![(2, 5.0), (1, 10.0)],
        vec![(1, 10.0), (2, 5.0)],
        vec![(4, 1.0), (1, 2.0), (4, 1.0)],
        vec![(4, 1.0), (1, 3.0), (4, 1.0)],
        vec![(4, 1.0), (2, 2.0), (4, 1.0)],
        vec![(4, 1.0), (1, 1.7), (4, 1.0)],
        vec![(4, 1.0), (1, 12.5), (4, 2.0)],
        vec![(2, 1.0), (1, 2.0), (1, 1.0), (1, 2.0), (3, 1.0)],
    ] {
        let error = at_heights(&steps(&hole)).expect_err("a hole");
        assert_eq!(error.code(), "missing_slice", "{hole:?}");
        assert!(error.instances().len() >= 2, "{hole:?}: {:?}", error.instances());
    }
    for (protocol, varies) in [
        (vec![(13, 4.0), (1, 1.081), (13, 7.0)], true),
        (vec![(10, 2.5), (10, 5.0)], true),
        (vec![(10, 5.0), (1, 7.0), (10, 10.0)], true),
        (vec![(3, 4.0), (3, 4.1)], false),
        (vec![(6, 0.625)], false),
    ] {
        let (volume, warnings) =
            at_heights(&steps(&protocol)).unwrap_or_else(|e| panic!("{protocol:?}: {e}"));
        assert_eq!(codes(&warnings).contains(&WarningCode::VariableSpacing), varies, "{protocol:?}");
        let heights: Vec<f64> = volume.grid.slice_origins().iter().map(|origin| origin[2]).collect();
        let expected = steps(&protocol);
        assert!(heights.iter().zip(expected.iter().rev()).all(|(a, b)| (a - b).abs() < 1e-6), "{protocol:?}");
    }
}

// ---- what is handled, with a warning ----

#[test]
fn a_slice_that_is_there_twice_counts_once() {
    let mut slices = usual();
    slices.push(Slice { uid: "1.2.3.4.77".into(), ..slices[2].clone() });
    let (volume, warnings) = read(files(&slices)).expect("a volume");
    assert_is_the_head(&volume, "with a duplicate");
    assert!(codes(&warnings).contains(&WarningCode::DuplicateInstances));
    assert_eq!(volume.sop_instance_uids[2].as_str(), "1.2.3.4.3");
}

#[test]
fn a_localizer_in_the_series_is_left_out() {
    let mut slices = files(&usual());
    let mut localizer = acquired([1, 0, 2], [false; 3]).swap_remove(0);
    localizer.uid = "1.2.3.4.99".into();
    let mut file = localizer.part10();
    let from = b"ORIGINAL\\PRIMARY\\AXIAL";
    let at = file.windows(from.len()).position(|bytes| bytes == from).expect("the type");
    file[at..at + from.len()].copy_from_slice(b"ORIGINAL\\PRI\\LOCALIZER");
    slices.push(file);
    let (volume, warnings) = read(slices).expect("a volume");
    assert_is_the_head(&volume, "with a localizer");
    assert!(codes(&warnings).contains(&WarningCode::IgnoredInstances));
}

#[test]
fn padding_becomes_air_and_values_out_of_range_are_clipped() {
    let mut slices = usual();
    slices[0].values[..4].copy_from_slice(&[500, 501, 502, i16::MIN]);
    let described = |slice: &Slice| {
        let pixels: Vec<u8> = slice.values.iter().flat_map(|value| value.to_le_bytes()).collect();
        slice
            .described(identity(CT, &slice.uid))
            .put((0x0028, 0x0120), "SS", &501_i16.to_le_bytes())
            .put((0x0028, 0x0121), "SS", &500_i16.to_le_bytes())
            .put((0x7FE0, 0x0010), "OW", &pixels)
            .part10(CT, &slice.uid, EXPLICIT)
    };
    let (volume, warnings) = read(slices.iter().map(described).collect()).expect("a volume");
    // The lowest slice is the last; its first row is the volume's last.
    let row: Vec<i16> = (0..5).map(|x| volume.hu[[4, 5, x]]).collect();
    assert_eq!(row[..4], [-1024, -1024, 502 - 24, i16::MIN]);
    let detail = |code| &warnings.iter().find(|warning| warning.code == code).expect("a warning").detail;
    assert!(detail(WarningCode::Padding).starts_with("2 pixels"), "{warnings:?}");
    assert!(detail(WarningCode::ClippedHu).starts_with("1 values"), "{warnings:?}");
}

#[test]
fn hounsfield_units_are_truncated_toward_zero() {
    let mut slices = usual();
    slices[4].values[..4].copy_from_slice(&[3, -3, 1, -1]);
    let described = |slice: &Slice| {
        let pixels: Vec<u8> = slice.values.iter().flat_map(|value| value.to_le_bytes()).collect();
        let file = slice.described(identity(CT, &slice.uid)).put((0x7FE0, 0x0010), "OW", &pixels);
        let mut file = file.part10(CT, &slice.uid, EXPLICIT);
        for (from, to) in [("-24.000000000", "0.00000000000"), ("1.000000000 ", "0.500000000 ")] {
            let all: Vec<usize> =
                (0..file.len() - from.len()).filter(|at| file[*at..].starts_with(from.as_bytes())).collect();
            let at = all[all.len() - 1];
            file[at..at + to.len()].copy_from_slice(to.as_bytes());
        }
        file
    };
    let (volume, _) = read(slices.iter().map(described).collect()).expect("a volume");
    let row: Vec<i16> = (0..4).map(|x| volume.hu[[0, 5, x]]).collect();
    assert_eq!(row, [1, -1, 0, 0]);
}

#[test]
fn instance_numbers_that_run_down_are_told_and_change_nothing() {
    let numbered = |down: bool| {
        let slices = usual();
        let count = slices.len();
        let file = |(index, slice): (usize, &Slice)| {
            let number = if down { count - index } else { index + 1 };
            let pixels: Vec<u8> = slice.values.iter().flat_map(|value| value.to_le_bytes()).collect();
            slice
                .described(identity(CT, &slice.uid).text((0x0020, 0x0013), "IS", &number.to_string()))
                .put((0x7FE0, 0x0010), "OW", &pixels)
                .part10(CT, &slice.uid, EXPLICIT)
        };
        read(slices.iter().enumerate().map(file).collect()).expect("a volume")
    };
    for down in [false, true] {
        let (volume, warnings) = numbered(down);
        assert_is_the_head(&volume, "numbered");
        assert_eq!(codes(&warnings).contains(&WarningCode::Descending), down);
    }
}

// ---- multi-frame ----

/// The usual scan as one Enhanced CT: shared orientation and spacing, a position for each frame.
fn enhanced(stack_of: impl Fn(usize) -> &'static str) -> Vec<u8> {
    let slices = usual();
    let first = &slices[0];
    let group = |tag, inner: DataSet| DataSet::default().sequence(tag, &[inner]);
    let shared = [
        group((0x0020, 0x9116), DataSet::default().decimals((0x0020, 0x0037), &first.orientation)),
        group((0x0028, 0x9110), DataSet::default().decimals((0x0028, 0x0030), &first.spacing)),
        group(
            (0x0028, 0x9145),
            DataSet::default()
                .decimals((0x0028, 0x1052), &[f64::from(Slice::INTERCEPT)])
                .decimals((0x0028, 0x1053), &[1.0])
                .text((0x0028, 0x1054), "LO", "HU"),
        ),
    ];
    let shared = DataSet(shared.into_iter().flat_map(|group| group.0).collect());
    // The frames stand in a muddled order.
    let order = [3, 0, 4, 1, 2];
    let frames: Vec<DataSet> = order
        .iter()
        .map(|index| {
            let content = DataSet::default().text((0x0020, 0x9056), "SH", stack_of(*index));
            let position = DataSet::default().decimals((0x0020, 0x0032), &slices[*index].position);
            DataSet([group((0x0020, 0x9111), content).0, group((0x0020, 0x9113), position).0].concat())
        })
        .collect();
    let pixels: Vec<u8> =
        order.iter().flat_map(|index| &slices[*index].values).flat_map(|value| value.to_le_bytes()).collect();
    identity(ENHANCED_CT, "1.2.3.4")
        .number((0x0028, 0x0002), 1)
        .text((0x0028, 0x0004), "CS", "MONOCHROME2")
        .text((0x0028, 0x0008), "IS", "5")
        .number((0x0028, 0x0010), first.rows)
        .number((0x0028, 0x0011), first.columns)
        .number((0x0028, 0x0100), 16)
        .number((0x0028, 0x0101), 16)
        .number((0x0028, 0x0102), 15)
        .number((0x0028, 0x0103), 1)
        .sequence((0x5200, 0x9229), &[shared])
        .sequence((0x5200, 0x9230), &frames)
        .put((0x7FE0, 0x0010), "OW", &pixels)
        .part10(ENHANCED_CT, "1.2.3.4", EXPLICIT)
}

#[test]
fn an_enhanced_ct_is_the_same_head() {
    let (volume, _) = read(vec![enhanced(|_| "1")]).expect("a volume");
    assert_is_the_head(&volume, "an Enhanced CT");
    assert_eq!(volume.sop_instance_uids, uids(&["1.2.3.4"; 5]));
    refused(vec![enhanced(|index| if index < 3 { "1" } else { "2" })], "several_stacks", &["1.2.3.4"]);
    // A frame without a functional group of its own has no place.
    let mut file = enhanced(|_| "1");
    let at = file.windows(4).position(|bytes| bytes == [0x28, 0, 0x08, 0]).expect("the number of frames");
    file[at + 8] = b'6';
    refused(vec![file], "missing_geometry", &["1.2.3.4"]);
}

// ---- real series ----

fn real(data: &Path, name: &str, folder: &str) -> Vec<Vec<u8>> {
    let is_instance = |path: &str| {
        !path.ends_with("DIRFILE")
            && !path.ends_with(".gz")
            && !path.ends_with(".txt")
            && !path.ends_with(".DS_Store")
    };
    data::series(data, name, folder)
        .into_iter()
        .filter(|(path, _)| is_instance(path))
        .map(|(_, bytes)| bytes)
        .collect()
}

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn broken_geometry_is_refused_with_the_instances_named() {
    let data = data::dir();
    for (folder, code, named) in [
        ("sliceincrement/001/", "missing_slice", 2),
        ("sliceincrement/002/", "missing_slice", 2),
        ("sliceorientation/", "mixed_orientation", 2),
        ("slicecount/", "too_few_slices", 2),
        ("notavolume/", "duplicate_position", 4),
        // Sound geometry, tilted by 14 degrees, of four slices.
        ("gantrytilting/", "too_few_slices", 4),
    ] {
        let files = real(&data, "broken_geometry", folder);
        let error = series::read(&Memory(files), &ReadLimits::default(), &Silent).expect_err(folder);
        assert_eq!((error.code(), error.instances().len()), (code, named), "{folder}: {error}");
    }
}

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn real_series_have_the_geometry_that_their_scanners_gave_them() {
    let data = data::dir();
    use WarningCode::{GantryTilt, Oblique, Padding, ThickSlices, VariableSpacing};
    // Name, slices, tilt, first and last z of the first pixels, warnings.
    for (name, slices, tilt, z, expected) in [
        (
            "ge_hispeed_tilt_variable",
            28,
            Some("18.50"),
            [157.776_058_6, 5.836_058_6],
            &[GantryTilt, VariableSpacing, ThickSlices, Oblique, Padding][..],
        ),
        ("philips_phantom_5mm", 28, None, [831.21, 696.21], &[ThickSlices]),
        ("philips_phantom_tilt_m18", 54, Some("18.50"), [f64::NAN; 2], &[GantryTilt, Oblique]),
        ("philips_phantom_tilt_p16", 58, Some("16.50"), [f64::NAN; 2], &[GantryTilt, Oblique]),
    ] {
        let (volume, warnings) =
            series::read(&Memory(real(&data, name, "")), &ReadLimits::default(), &Silent).expect(name);
        assert_eq!(volume.hu.dim(), (slices, 512, 512), "{name}");
        assert_eq!(volume.grid.slice_axis(), Axis::Z, "{name}");
        let mut expected = expected.to_vec();
        expected.sort();
        assert_eq!(codes(&warnings), expected, "{name}");
        let found = warnings.iter().find(|warning| warning.code == GantryTilt);
        assert_eq!(
            found.map(|warning| warning.detail.contains(tilt.unwrap_or("none"))),
            tilt.map(|_| true),
            "{name}"
        );
        // The first DICOM row is the volume's last: y = 511.
        for (index, z) in [0, slices - 1].into_iter().zip(z).filter(|(_, z)| !z.is_nan()) {
            let is = volume.grid.lps([index, 511, 0]);
            assert!((is[2] - z).abs() < 1e-6, "{name}: {is:?}");
        }
    }
}
