//! What else a series holds beside its slices, and instances of two patients or two studies in one.

use triplanar::dicom::header::InstanceHeader;
use triplanar::dicom::scan::{Encoding, Limits, scan};
use triplanar::dicom::series::UnfitReason;
use triplanar::dicom::series::{self, ReadLimits, SeriesError, Warning, WarningCode, unfit};
use triplanar::dicom::{Volume, content_digest};
use triplanar::observer::Silent;

use crate::support::dicom::{CT, DataSet, EXPLICIT, Memory, Slice, identity};

const SLICES: usize = 10;

fn read(files: &[Vec<u8>]) -> Result<(Volume, Vec<Warning>), SeriesError> {
    series::read(&Memory(files.to_vec()), &ReadLimits::default(), &Silent)
}

fn slice(index: usize) -> Slice {
    Slice::small(index, vec![i16::try_from(index).expect("few"); 24])
}

/// Ten good slices, each with what is told put into its data set.
fn ten(more: impl Fn(usize, DataSet) -> DataSet) -> Vec<Vec<u8>> {
    (0..SLICES)
        .map(|index| {
            let slice = slice(index);
            let pixels: Vec<u8> = slice.values.iter().flat_map(|value| value.to_le_bytes()).collect();
            more(index, slice.described(identity(CT, &slice.uid)))
                .put((0x7FE0, 0x0010), "OW", &pixels)
                .part10(CT, &slice.uid, EXPLICIT)
        })
        .collect()
}

fn good() -> Vec<Vec<u8>> {
    ten(|_, data_set| data_set)
}

/// A picture of the series that is no slice: with that Image Type, photometric interpretation and
/// samples per pixel, and a place if there is one.
fn picture(image_type: &str, photometric: &str, samples: u16, place: Option<[f64; 3]>) -> Vec<u8> {
    let uid = "1.2.3.4.99";
    let mut data_set = DataSet::default()
        .text((0x0008, 0x0008), "CS", image_type)
        .text((0x0008, 0x0016), "UI", CT)
        .text((0x0008, 0x0018), "UI", uid)
        .text((0x0008, 0x0060), "CS", "CT")
        .text((0x0020, 0x000D), "UI", "1.2.3.1")
        .text((0x0020, 0x000E), "UI", "1.2.3.2")
        .text((0x0020, 0x0052), "UI", "1.2.3.3");
    if let Some(place) = place {
        data_set = data_set
            .decimals((0x0020, 0x0032), &place)
            .decimals((0x0020, 0x0037), &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0])
            .decimals((0x0028, 0x0030), &[1.0, 1.0]);
    }
    data_set
        .number((0x0028, 0x0002), samples)
        .text((0x0028, 0x0004), "CS", photometric)
        .number((0x0028, 0x0010), 4)
        .number((0x0028, 0x0011), 6)
        .number((0x0028, 0x0100), 8)
        .number((0x0028, 0x0101), 8)
        .number((0x0028, 0x0102), 7)
        .number((0x0028, 0x0103), 0)
        .put((0x7FE0, 0x0010), "OW", &vec![0; 24 * usize::from(samples)])
        .part10(CT, uid, EXPLICIT)
}

#[test]
fn a_picture_that_is_no_slice_is_equal_to_itself_and_to_no_other() {
    let digest = |file: &[u8]| content_digest(file, &Limits::default()).expect("it need not be decoded");
    let file = picture("DERIVED\\SECONDARY\\OTHER", "RGB", 3, None);
    let other_type = picture("DERIVED\\SECONDARY\\SCREEN SAVE", "RGB", 3, None);
    assert_eq!(digest(&file), digest(&other_type), "its pixels are the same");
    let mut changed = file.clone();
    *changed.last_mut().expect("pixels") ^= 1;
    assert_ne!(digest(&file), digest(&changed));
    assert_ne!(digest(&file), digest(&picture("DERIVED\\SECONDARY\\OTHER", "YBR_FULL", 3, None)));
    // The same samples in another order, of other bits, under other colours.
    let with = |tag, value: &[u8]| {
        let bytes = picture("DERIVED\\SECONDARY\\OTHER", "PALETTE COLOR", 3, None);
        let at = bytes.windows(4).position(|tag| tag == [0x28, 0, 0x10, 0]).expect("Rows");
        let mut element = DataSet::default().put(tag, "US", value).0;
        element.extend_from_slice(&bytes[at..]);
        [&bytes[..at], &element].concat()
    };
    for tag in [(0x0028, 0x0006), (0x0028, 0x1101), (0x0028, 0x1203), (0x0028, 0x1221)] {
        assert_ne!(digest(&with(tag, &[1, 0])), digest(&with(tag, &[0, 0])), "{tag:?}");
    }
}

fn header(file: &[u8]) -> InstanceHeader {
    let mut header =
        scan(std::io::Cursor::new(file), &Encoding::Part10, &Limits::default()).expect("valid").header;
    header.image_type.truncate(8);
    header
}

#[test]
fn a_picture_among_good_slices_is_left_out_with_its_reason() {
    let plain = read(&good()).expect("a volume").0;
    for (image_type, photometric, samples, reason) in [
        ("DERIVED\\SECONDARY\\SCREEN SAVE", "RGB", 3, UnfitReason::SecondaryCapture),
        ("DERIVED\\SECONDARY\\SCREEN SAVE", "PALETTE COLOR", 1, UnfitReason::SecondaryCapture),
        ("DERIVED\\SECONDARY\\OTHER", "RGB", 3, UnfitReason::Colour),
        ("DERIVED\\SECONDARY\\OTHER", "PALETTE COLOR", 1, UnfitReason::Colour),
        ("ORIGINAL\\PRIMARY\\OTHER", "YBR_FULL_422", 3, UnfitReason::Colour),
        ("ORIGINAL\\PRIMARY\\OTHER", "MONOCHROME2", 3, UnfitReason::Colour),
        ("DERIVED\\SECONDARY\\OTHER", "MONOCHROME2", 1, UnfitReason::NoPlace),
    ] {
        let what = format!("{image_type} {photometric} {samples}");
        let mut files = good();
        files.insert(3, picture(image_type, photometric, samples, None));
        let (volume, warnings) = read(&files).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!(volume.hu, plain.hu, "{what}");
        let warning = warnings.iter().find(|warning| warning.code == WarningCode::IgnoredInstances);
        let named = &warning.unwrap_or_else(|| panic!("{what}: no warning")).instances;
        assert_eq!(named.len(), 1, "{what}");
        assert_eq!((named[0].sop_instance_uid.as_str(), named[0].reason), ("1.2.3.4.99", reason), "{what}");
        // What the headers tell at completeness is what the job finds.
        let headers: Vec<_> = files.iter().map(|file| header(file)).collect();
        assert_eq!(unfit(&headers, SLICES), None, "{what}");
        assert_eq!(unfit(&headers, SLICES + 1), Some(UnfitReason::TooFewSlices), "{what}: it is no slice");
        assert_eq!(unfit(&headers[3..4], 1), Some(reason), "{what}");
        assert_eq!(read(&files[3..4]).expect_err("no slice").code(), "not_ct", "{what}");
    }
}

#[test]
fn a_gray_image_without_its_place_fails_unless_it_says_that_it_is_made_of_others() {
    let mut files = good();
    files.push(picture("ORIGINAL\\PRIMARY\\AXIAL", "MONOCHROME2", 1, None));
    let error = read(&files).expect_err("a slice that lost its place");
    assert_eq!((error.code(), error.instances()[0].as_str()), ("missing_geometry", "1.2.3.4.99"));
}

#[test]
fn a_picture_of_a_slice_is_left_out_and_one_in_the_place_of_a_slice_is_not() {
    // At the place of a slice that is there.
    let mut files = good();
    files.push(picture("DERIVED\\SECONDARY\\OTHER", "RGB", 3, Some(slice(4).position)));
    assert!(read(&files).is_ok());
    // A slice of the scan, sent in colour: the series has a hole.
    files.remove(4);
    let error = read(&files).expect_err("a hole");
    assert_eq!(error.code(), "missing_slice");
    assert!(error.instances().iter().any(|uid| uid.as_str() == "1.2.3.4.99"), "{error}");
    // Every other slice in colour: the steps that are left are regular.
    let files: Vec<_> = (0..2 * SLICES)
        .map(|index| {
            if index % 2 == 0 {
                return slice(index).part10();
            }
            let file = picture("ORIGINAL\\PRIMARY\\AXIAL", "RGB", 3, Some(slice(index).position));
            let text = format!("1.2.3.4.{}", index + 10);
            let uid = |bytes: &[u8]| bytes.windows(10).position(|part| part == b"1.2.3.4.99");
            let mut file = file;
            while let Some(at) = uid(&file) {
                file[at..at + 10].copy_from_slice(text.as_bytes());
            }
            file
        })
        .collect();
    let error = read(&files).expect_err("half of the scan");
    assert_eq!((error.code(), error.instances().len()), ("missing_slice", SLICES - 1), "{error}");
}

#[test]
fn a_lossy_picture_left_out_is_no_lossy_volume() {
    let mut files = good();
    let lossy = DataSet(DataSet::default().text((0x0008, 0x0008), "CS", "DERIVED\\SECONDARY\\SCREEN SAVE").0);
    let lossy = lossy
        .text((0x0008, 0x0016), "UI", CT)
        .text((0x0008, 0x0018), "UI", "1.2.3.4.98")
        .text((0x0020, 0x000D), "UI", "1.2.3.1")
        .text((0x0020, 0x000E), "UI", "1.2.3.2")
        .text((0x0028, 0x2110), "CS", "01")
        .put((0x7FE0, 0x0010), "OW", &[0; 48]);
    files.push(lossy.part10(CT, "1.2.3.4.98", EXPLICIT));
    let (_, warnings) = read(&files).expect("a volume");
    assert!(!warnings.iter().any(|warning| warning.code == WarningCode::LossyCompression), "{warnings:?}");
}

// ---- two patients, two studies ----

/// Ten slices of which the last four have the second value.
fn parted(tag: (u16, u16), vr: &'static str, one: &'static str, other: &'static str) -> Vec<Vec<u8>> {
    ten(move |index, data_set| data_set.text(tag, vr, if index < 6 { one } else { other }))
}

fn both_sets_named(files: &[Vec<u8>], code: &str) {
    let error = read(files).expect_err(code);
    assert_eq!(error.code(), code, "{error}");
    let named: Vec<_> = error.instances().iter().map(ToString::to_string).collect();
    let all: Vec<_> = (0..SLICES).map(|index| format!("1.2.3.4.{}", index + 10)).collect();
    assert_eq!(named, all, "the six first, then the four others");
    assert!(error.to_string().contains("6, then 4"), "{error}");
    for value in ["ALICE", "BOB", "Alice", "Bob", "19500101", "19900101"] {
        assert!(!error.to_string().contains(value), "{error}");
    }
}

#[test]
fn two_patients_in_one_series_are_refused_and_both_sets_named() {
    for (tag, vr, one, other) in [
        ((0x0010, 0x0020), "LO", "ALICE", "BOB"),
        ((0x0010, 0x0010), "PN", "Alice^A", "Bob^B"),
        ((0x0010, 0x0021), "LO", "ALICE", "BOB"),
        ((0x0010, 0x0030), "DA", "19500101", "19900101"),
    ] {
        both_sets_named(&parted(tag, vr, one, other), "mixed_patient");
    }
}

#[test]
fn one_patient_written_in_two_ways_is_one_volume() {
    for (tag, vr, one, other) in [
        ((0x0010, 0x0020), "LO", "4711", " 4711  "),
        ((0x0010, 0x0020), "LO", "4711", ""),
        ((0x0010, 0x0010), "PN", "DOE^JOHN", "Doe^John^^"),
        ((0x0010, 0x0010), "PN", "DOE^JOHN", "DOE^JOHN=X^Y"),
        ((0x0010, 0x0030), "DA", "19500101", ""),
    ] {
        if let Err(error) = read(&parted(tag, vr, one, other)) {
            panic!("{one:?} and {other:?}: {error}");
        }
    }
}

/// Patient ID and Patient's Name.
type Person = (&'static str, &'static str);

/// Ten slices of which the first six say the one and the last four the other.
fn people(of: impl Fn(usize) -> Person) -> Vec<Vec<u8>> {
    ten(|index, data_set| {
        let (id, name) = of(index);
        let data_set = if name.is_empty() { data_set } else { data_set.text((0x0010, 0x0010), "PN", name) };
        if id.is_empty() { data_set } else { data_set.text((0x0010, 0x0020), "LO", id) }
    })
}

#[test]
fn one_patients_id_over_slices_that_carry_only_anothers_name_is_refused_and_both_sets_named() {
    let pairs: [(Person, Person); 5] = [
        (("ALICE", ""), ("", "Bob^B")),
        (("", "Alice^A"), ("BOB", "")),
        (("ALICE", "Alice^A"), ("", "Bob^B")),
        (("ALICE", "Alice^A"), ("ALICE", "Bob^B")),
        (("ALICE", "Alice^A"), ("BOB", "Alice^A")),
    ];
    for (one, other) in pairs {
        both_sets_named(&people(|index| if index < 6 { one } else { other }), "mixed_patient");
    }
    // Those without a name belong to whom they share the ID with.
    let by_id = |index| match index {
        0..3 => ("ALICE", "Alice^A"),
        3..6 => ("ALICE", ""),
        _ => ("", "Bob^B"),
    };
    both_sets_named(&people(by_id), "mixed_patient");
}

#[test]
fn an_id_and_a_name_that_one_instance_links_are_one_patient() {
    let ways: [&dyn Fn(usize) -> Person; 4] = [
        &|index| match index {
            0..4 => ("4711", ""),
            4 => ("4711", "DOE^JOHN"),
            _ => ("", "Doe^John^^"),
        },
        &|index| if index < 5 { ("4711", "DOE^JOHN") } else { ("", "DOE^JOHN") },
        &|index| if index < 5 { ("4711", "") } else { ("", "") },
        &|index| if index < 5 { ("", "DOE^JOHN") } else { ("", "") },
    ];
    for (number, way) in ways.into_iter().enumerate() {
        if let Err(error) = read(&people(way)) {
            panic!("{number}: {error}");
        }
    }
}

#[test]
fn two_studies_in_one_series_are_refused_and_both_sets_named() {
    let mut files = good();
    for file in &mut files[6..] {
        let at = file.windows(7).position(|part| part == b"1.2.3.1").expect("the study");
        file[at + 6] = b'9';
    }
    both_sets_named(&files, "mixed_study");
}

// ---- too far apart ----

#[test]
fn slices_farther_apart_than_a_surface_can_be_told_are_no_volume() {
    let apart = |step: f64| {
        let file = |index: usize| {
            let mut slice = slice(index);
            slice.position[2] = step * index as f64;
            slice.part10()
        };
        read(&(0..SLICES).map(file).collect::<Vec<_>>())
    };
    assert!(apart(20.0).is_ok());
    let error = apart(20.1).expect_err("too far apart");
    assert_eq!((error.code(), error.instances().len()), ("slices_too_far_apart", SLICES), "{error}");
    assert!(error.to_string().contains("20 mm") && error.to_string().contains("20.100 mm"), "{error}");
}
