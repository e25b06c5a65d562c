//! Slices of one series that say another rescale than their neighbours: one that their values have is no
//! matter, one that they don't have is an error or a doubt, however many slices it is.

use dicom_core::{DataElement, PrimitiveValue, Tag, VR};
use dicom_dictionary_std::tags;
use triplanar::dicom::series::{self, ReadLimits, RowsDoubt, SeriesError, Warning, WarningCode};
use triplanar::dicom::{Volume, uid::SopInstanceUid};
use triplanar::observer::Silent;

use crate::dicom_damage::{head, reconstruct, sop_instance_uid};
use crate::support::dicom::Memory;

/// A slice of the head with other attributes, and its stored values changed.
fn changed(file: &[u8], texts: &[(Tag, VR, &str)], values: impl Fn(i32) -> i32) -> Vec<u8> {
    let mut object = dicom_object::from_reader(file).expect("a DICOM file");
    for (tag, vr, text) in texts {
        let value = match vr {
            &VR::US => PrimitiveValue::from(text.parse::<u16>().expect("a number")),
            _ => PrimitiveValue::from(*text),
        };
        object.put(DataElement::new(*tag, *vr, value));
    }
    let pixels = object.element(tags::PIXEL_DATA).expect("pixels").to_bytes().expect("bytes").to_vec();
    let (pixels, _) = pixels.as_chunks::<2>();
    let stored = pixels.iter().map(|two| values(i32::from(u16::from_le_bytes(*two))) & 0xFFFF);
    let pixels: Vec<u16> = stored.map(|value| u16::try_from(value).expect("16 bits")).collect();
    object.put(DataElement::new(tags::PIXEL_DATA, VR::OW, PrimitiveValue::U16(pixels.into())));
    let mut file = Vec::new();
    object.write_all(&mut file).expect("a file");
    file
}

/// The head with the rescale of some slices, and their stored values, changed.
fn rescaled(
    which: impl Fn(usize) -> bool,
    slope: &str,
    intercept: &str,
    values: impl Fn(i32) -> i32 + Copy,
) -> Vec<Vec<u8>> {
    let rescale = [(tags::RESCALE_SLOPE, VR::DS, slope), (tags::RESCALE_INTERCEPT, VR::DS, intercept)];
    let slices = head().files.iter().enumerate();
    slices.map(|(z, file)| if which(z) { changed(file, &rescale, values) } else { file.clone() }).collect()
}

fn read(files: &[Vec<u8>]) -> Result<(Volume, Vec<Warning>), SeriesError> {
    series::read(&Memory(files.to_vec()), &ReadLimits::default(), &Silent)
}

/// The instances of those slices, sorted.
fn instances(which: impl Fn(usize) -> bool) -> Vec<SopInstanceUid> {
    let files = head().files.iter().enumerate().filter(|(z, _)| which(*z));
    let mut uids: Vec<SopInstanceUid> =
        files.map(|(_, file)| sop_instance_uid(file).parse().expect("a UID")).collect();
    uids.sort();
    uids
}

/// Slices of a series.
type Which = fn(usize) -> bool;

#[test]
fn a_rescale_that_the_values_do_not_have_is_refused_however_many_slices_say_it() {
    let which: [(&str, Which); 7] = [
        ("the upper half", |z| z >= 37),
        ("one", |z| z == 40),
        ("every second", |z| z % 2 == 1),
        ("a third in the middle", |z| (25..50).contains(&z)),
        ("the first", |z| z == 0),
        ("the last", |z| z == 74),
        ("all but ten", |z| z >= 10),
    ];
    for (what, which) in which {
        for intercept in ["0", "-2048"] {
            let error = read(&rescaled(which, "1", intercept, |v| v)).expect_err(what);
            assert_eq!(error.code(), "inconsistent_levels", "{what} {intercept}: {error}");
            assert_eq!(error.instances(), instances(which), "{what} {intercept}: {error}");
        }
    }
    let error = read(&rescaled(|z| z >= 37, "1", "0", |v| v)).expect_err("half");
    let text = error.to_string();
    assert!(text.contains("RescaleIntercept (0028,1052)") && text.contains("intercept 0"), "{text}");
    // A slope is in the tissue alone.
    for slope in ["2", "0.5"] {
        let error = read(&rescaled(|z| z >= 37, slope, "-1024", |v| v)).expect_err(slope);
        assert_eq!(error.code(), "inconsistent_levels", "{error}");
        assert_eq!(error.instances(), instances(|z| z >= 37), "{error}");
    }
}

#[test]
fn a_smaller_difference_is_a_doubt_of_those_slices() {
    let half = |z: usize| z >= 37;
    let (volume, warnings) = read(&rescaled(half, "1", "-900", |v| v)).expect("a volume");
    assert_eq!(volume.doubtful_slices.len(), 38);
    let warning = warnings.iter().find(|warning| warning.code == WarningCode::InconsistentLevels);
    let rows = &warning.expect("a warning").rows;
    assert!(
        rows.iter().all(|row| row.doubt == RowsDoubt::Step && (row.measured - 124.0).abs() < 5.0),
        "{rows:?}"
    );
    let mut named: Vec<_> = rows.iter().map(|row| row.sop_instance_uid.clone()).collect();
    named.sort();
    assert_eq!(named, instances(half));
}

#[test]
fn values_that_lost_their_offset_under_one_rescale_are_a_doubt() {
    // A writer that gives all slices one intercept and leaves the values of some as they were.
    let half = |z: usize| z >= 37;
    let (volume, warnings) = read(&rescaled(half, "1", "-1024", |v| v + 1024)).expect("a volume");
    assert_eq!(volume.doubtful_slices.len(), 38, "{warnings:?}");
}

#[test]
fn bits_that_are_read_in_another_way_than_they_are_meant_are_refused() {
    let half = |z: usize| z >= 37;
    // Hounsfield units with their sign, of which half of the slices say nothing.
    let signed = |z: usize| if half(z) { "0" } else { "1" };
    let slices = || head().files.iter().enumerate();
    let of = |z| [(tags::RESCALE_INTERCEPT, VR::DS, "0"), (tags::PIXEL_REPRESENTATION, VR::US, signed(z))];
    let files: Vec<_> = slices().map(|(z, file)| changed(file, &of(z), |v| v - 1024)).collect();
    let error = read(&files).expect_err("half without a sign");
    assert_eq!((error.code(), error.instances()), ("inconsistent_levels", &instances(half)[..]), "{error}");
    // Half of the slices without the upper bits of their values.
    let bits = [(tags::BITS_STORED, VR::US, "8"), (tags::HIGH_BIT, VR::US, "7")];
    let files: Vec<_> = slices()
        .map(|(z, file)| if half(z) { changed(file, &bits, |v| v & 0xFF) } else { file.clone() })
        .collect();
    let error = read(&files).expect_err("half of 8 bits");
    assert_eq!((error.code(), error.instances()), ("inconsistent_levels", &instances(half)[..]), "{error}");
}

#[test]
fn an_honest_rescale_of_each_slice_is_no_matter() {
    let plain = read(&head().files).expect("a volume").0;
    // As PET-CT and some CT scanners write: each slice its own, some of them far from the others'.
    let intercepts = [-1024, -1500, -2048, -1100, -3000];
    let files: Vec<Vec<u8>> = head()
        .files
        .iter()
        .enumerate()
        .map(|(z, file)| {
            let intercept = intercepts[z % intercepts.len()];
            let text = intercept.to_string();
            let rescale = [(tags::RESCALE_INTERCEPT, VR::DS, text.as_str())];
            changed(file, &rescale, |v| v - 1024 - intercept)
        })
        .collect();
    let (volume, warnings) = read(&files).expect("a volume");
    assert!(warnings.iter().all(|warning| warning.code != WarningCode::InconsistentLevels), "{warnings:?}");
    assert_eq!(volume.hu, plain.hu);
    // Half of the slices in steps of half a unit, and half in other bits.
    let half = |z: usize| z >= 37;
    let (volume, warnings) = read(&rescaled(half, "0.5", "-1024", |v| 2 * v)).expect("a volume");
    assert_eq!(volume.hu, plain.hu);
    assert!(warnings.iter().all(|warning| warning.code != WarningCode::InconsistentLevels), "{warnings:?}");
    let bits = [(tags::BITS_STORED, VR::US, "12"), (tags::HIGH_BIT, VR::US, "11")];
    let slices = head().files.iter().enumerate();
    let files: Vec<_> = slices
        .map(|(z, file)| if half(z) { changed(file, &bits, |v| v.min(4095)) } else { file.clone() })
        .collect();
    let (_, warnings) = read(&files).expect("a volume");
    assert!(warnings.iter().all(|warning| warning.code != WarningCode::InconsistentLevels), "{warnings:?}");
}

#[test]
fn half_of_the_slices_without_a_rescale_or_in_another_unit_are_named() {
    let half = |z: usize| z.is_multiple_of(2);
    let slices = || head().files.iter().enumerate();
    let unit = [(tags::RESCALE_TYPE, VR::LO, "OD")];
    let other: Vec<_> =
        slices().map(|(z, file)| if half(z) { changed(file, &unit, |v| v) } else { file.clone() }).collect();
    let error = read(&other).expect_err("another unit");
    assert_eq!((error.code(), error.instances()), ("no_rescale", &instances(half)[..]), "{error}");
    let empty = [(tags::RESCALE_INTERCEPT, VR::DS, "")];
    let without: Vec<_> =
        slices().map(|(z, file)| if half(z) { changed(file, &empty, |v| v) } else { file.clone() }).collect();
    let error = read(&without).expect_err("no intercept");
    assert_eq!((error.code(), error.instances()), ("no_rescale", &instances(half)[..]), "{error}");
}

#[test]
fn the_command_refuses_half_a_series_of_another_rescale() {
    let dir = tempfile::tempdir().expect("a folder");
    let (code, text, _) = reconstruct(dir.path(), &rescaled(|z| z >= 37, "1", "0", |v| v), "precise");
    assert_eq!(code, Some(4), "{text}");
    assert!(text.contains("inconsistent_levels") && text.contains("RescaleIntercept"), "{text}");
}
