//! Data sets that are not quite encoded as the standard says, as archives and scanners send them.
//! What pydicom makes of such a file (2.4, `dcmread`) is what is expected.

use std::io::{Cursor, Write as _};

use flate2::Compression;
use flate2::write::DeflateEncoder;
use triplanar::dicom::Volume;
use triplanar::dicom::scan::{Encoding, Limits, ScanError, scan};
use triplanar::dicom::series::{self, ReadLimits, SeriesError, Warning, WarningCode};
use triplanar::observer::Silent;

use crate::support::dicom::{CT, DataSet, ENHANCED_CT, EXPLICIT, Memory, Slice, identity};

const DEFLATED: &str = "1.2.840.10008.1.2.1.99";
const ITEM: [u8; 4] = [0xFE, 0xFF, 0x00, 0xE0];
const END_OF_ITEM: [u8; 8] = [0xFE, 0xFF, 0x0D, 0xE0, 0, 0, 0, 0];
const END_OF_SEQUENCE: [u8; 8] = [0xFE, 0xFF, 0xDD, 0xE0, 0, 0, 0, 0];
const UNDEFINED: [u8; 4] = [0xFF; 4];

fn tag(tag: (u16, u16)) -> [u8; 4] {
    let ([a, b], [c, d]) = (tag.0.to_le_bytes(), tag.1.to_le_bytes());
    [a, b, c, d]
}

fn length(of: &[u8]) -> [u8; 4] {
    u32::try_from(of.len()).expect("short").to_le_bytes()
}

/// An element without VR.
fn implicit(at: (u16, u16), value: &[u8]) -> Vec<u8> {
    [&tag(at), &length(value), value].concat()
}

/// An element with VR and a length of 32 bits.
fn long(at: (u16, u16), vr: &[u8; 2], length: [u8; 4], value: &[u8]) -> Vec<u8> {
    [&tag(at), &vr[..], &[0, 0], &length, value].concat()
}

/// An item of defined length.
fn item(content: &[u8]) -> Vec<u8> {
    [&ITEM, &length(content), content].concat()
}

fn explicit_code() -> Vec<u8> {
    DataSet::default().text((0x0008, 0x0100), "SH", "T-D1100 ").text((0x0008, 0x0102), "SH", "SRT ").0
}

fn implicit_code() -> Vec<u8> {
    [implicit((0x0008, 0x0100), b"T-D1100 "), implicit((0x0008, 0x0102), b"SRT ")].concat()
}

fn read(files: Vec<Vec<u8>>) -> Result<(Volume, Vec<Warning>), SeriesError> {
    series::read(&Memory(files), &ReadLimits { min_slices: 3, ..ReadLimits::default() }, &Silent)
}

fn has(warnings: &[Warning], code: WarningCode) -> bool {
    warnings.iter().any(|warning| warning.code == code)
}

fn slice(index: usize) -> Slice {
    Slice::small(index, (0..24).map(|value| value + 100 * i16::try_from(index).expect("few")).collect())
}

fn pixels(of: &Slice) -> Vec<u8> {
    of.values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Five slices with `odd` behind the elements of group 28.
fn with(odd: &[u8], transfer_syntax: &str) -> Vec<Vec<u8>> {
    let file = |index: usize| {
        let slice = slice(index);
        let mut data_set = slice.described(identity(CT, &slice.uid));
        data_set.0.extend(odd);
        let mut data_set = data_set.put((0x7FE0, 0x0010), "OW", &pixels(&slice));
        if transfer_syntax == DEFLATED {
            let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
            encoder.write_all(&data_set.0).expect("memory");
            data_set = DataSet(encoder.finish().expect("memory"));
        }
        data_set.part10(CT, &slice.uid, transfer_syntax)
    };
    (0..5).map(file).collect()
}

#[test]
fn what_nobody_reads_is_passed_over_with_a_warning() {
    let plain = read(with(&[], EXPLICIT)).expect("a volume");
    assert!(!has(&plain.1, WarningCode::OddEncoding));
    let (code, bare) = (explicit_code(), implicit_code());
    let private = (0x2001, 0x1090);
    let undefined = |vr, content: &[u8]| long(private, vr, UNDEFINED, &[content, &END_OF_SEQUENCE].concat());
    let known = |content: &[u8]| long((0x0008, 0x1032), b"SQ", length(content), content);
    let mut claims_too_much = item(&code);
    claims_too_much[14] = 200;
    for (what, odd, bytes) in [
        ("a private element without VR", true, implicit((0x0043, 0x1027), b"/1.0:1 ")),
        (
            "items without VR in a sequence with VR",
            true,
            undefined(b"SQ", &[&ITEM[..], &UNDEFINED, &bare, &END_OF_ITEM].concat()),
        ),
        ("items with VR in a UN sequence", true, undefined(b"UN", &item(&code))),
        (
            "items without VR in a UN sequence, as they should",
            false,
            undefined(b"UN", &[&ITEM[..], &UNDEFINED, &bare, &END_OF_ITEM].concat()),
        ),
        ("a delimiter inside the length", true, known(&[&item(&code)[..], &END_OF_SEQUENCE].concat())),
        ("a delimiter behind the length", true, [known(&item(&code)), END_OF_SEQUENCE.to_vec()].concat()),
        ("a delimiter inside the item", true, known(&item(&[&code[..], &END_OF_ITEM].concat()))),
        (
            "a delimiter behind the item",
            true,
            long(
                private,
                b"SQ",
                UNDEFINED,
                &[&item(&code)[..], &END_OF_ITEM, &item(&code), &END_OF_SEQUENCE].concat(),
            ),
        ),
        ("a value that claims more than its item", true, known(&claims_too_much)),
        ("a sequence of no items", true, known(b"no item is here")),
        ("a sequence that ends in the middle of a head", true, known(&item(&code)[..26])),
        ("the same within another", true, known(&item(&known(&item(&code[..5]))))),
    ] {
        for transfer_syntax in [EXPLICIT, DEFLATED] {
            let files = with(&bytes, transfer_syntax);
            let scanned = scan(Cursor::new(&files[0]), &Encoding::Part10, &Limits::default());
            let scanned = scanned.unwrap_or_else(|error| panic!("{what}: {error}"));
            assert!(scanned.header.has_pixel_data, "{what}");
            let (volume, warnings) = read(files).unwrap_or_else(|error| panic!("{what}: {error}"));
            assert_eq!(volume.hu, plain.0.hu, "{what}");
            assert_eq!(has(&warnings, WarningCode::OddEncoding), odd, "{what}: {warnings:?}");
        }
    }
}

#[test]
fn items_with_vr_in_a_data_set_without_are_passed_over() {
    let mut data_set = Vec::new();
    for (at, value) in [
        ((0x0008, 0x0016), CT.as_bytes()),
        ((0x0008, 0x0018), b"1.2.3.44"),
        ((0x0020, 0x000D), b"1.2.3.40"),
        ((0x0020, 0x000E), b"1.2.3.41"),
    ] {
        let padded = [value, &vec![0; value.len() % 2]].concat();
        data_set.extend(implicit(at, &padded));
    }
    data_set.extend(tag((0x2001, 0x1090)));
    data_set.extend(UNDEFINED);
    data_set.extend([&ITEM[..], &UNDEFINED, &explicit_code(), &END_OF_ITEM, &END_OF_SEQUENCE].concat());
    data_set.extend(implicit((0x7FE0, 0x0010), &[0; 8]));
    let implicit_little_endian = Encoding::DataSet("1.2.840.10008.1.2".parse().expect("a UID"));
    let found =
        scan(Cursor::new(&data_set), &implicit_little_endian, &Limits::default()).expect("passed over");
    assert!(found.header.has_pixel_data);
}

#[test]
fn what_is_read_or_has_no_end_is_refused_as_before() {
    let refused = |bytes: &[u8]| {
        let data_set = DataSet([&identity(CT, "1.2.3.4").0, bytes].concat());
        let file = data_set.part10(CT, "1.2.3.4", EXPLICIT);
        match scan(Cursor::new(file), &Encoding::Part10, &Limits::default()) {
            Err(ScanError::Malformed(_)) => {}
            other => panic!("{bytes:02x?}: {other:?}"),
        }
    };
    // The functional groups, whatever their VR says.
    for vr in [b"SQ", b"UN"] {
        let content = item(&explicit_code()[..9]);
        refused(&long((0x5200, 0x9230), vr, length(&content), &content));
    }
    // A standard element without VR.
    refused(&implicit((0x0028, 0x1050), b"40  "));
    // A sequence of undefined length with rubbish in it: its end is not known.
    refused(&long((0x0008, 0x1032), b"SQ", UNDEFINED, b"no item is here"));
    // A delimiter that closes nothing.
    refused(&[DataSet::default().text((0x0028, 0x1050), "DS", "40").0, END_OF_SEQUENCE.to_vec()].concat());
}

#[test]
fn functional_groups_as_un_are_read() {
    let group = |at, inner: Vec<u8>| implicit(at, &item(&inner));
    let text = |at, text: &str| {
        implicit(at, format!("{text:<width$}", width = text.len().next_multiple_of(2)).as_bytes())
    };
    let shared = item(
        &[
            group((0x0020, 0x9116), text((0x0020, 0x0037), "1\\0\\0\\0\\1\\0")),
            group((0x0028, 0x9110), text((0x0028, 0x0030), "1\\1")),
            group(
                (0x0028, 0x9145),
                [text((0x0028, 0x1052), "-24"), text((0x0028, 0x1053), "1"), text((0x0028, 0x1054), "hu")]
                    .concat(),
            ),
        ]
        .concat(),
    );
    let frame = |index: usize| {
        let position = slice(index).position.map(|value| value.to_string()).join("\\");
        item(&group((0x0020, 0x9113), text((0x0020, 0x0032), &position)))
    };
    let frames = (0..5).flat_map(frame).collect::<Vec<u8>>();
    let expected = read(with(&[], EXPLICIT)).expect("a volume").0;
    for is_defined in [true, false] {
        let un = |at, content: &[u8]| {
            if is_defined {
                long(at, b"UN", length(content), content)
            } else {
                long(at, b"UN", UNDEFINED, &[content, &END_OF_SEQUENCE].concat())
            }
        };
        let mut data_set = identity(ENHANCED_CT, "1.2.3.4")
            .number((0x0028, 0x0002), 1)
            .text((0x0028, 0x0004), "CS", "MONOCHROME2")
            .text((0x0028, 0x0008), "IS", "5")
            .number((0x0028, 0x0010), 4)
            .number((0x0028, 0x0011), 6)
            .number((0x0028, 0x0100), 16)
            .number((0x0028, 0x0101), 16)
            .number((0x0028, 0x0102), 15)
            .number((0x0028, 0x0103), 1);
        data_set.0.extend(un((0x5200, 0x9229), &shared));
        data_set.0.extend(un((0x5200, 0x9230), &frames));
        let all: Vec<u8> = (0..5).flat_map(|index| pixels(&slice(index))).collect();
        let file = data_set.put((0x7FE0, 0x0010), "OW", &all).part10(ENHANCED_CT, "1.2.3.4", EXPLICIT);
        let (volume, warnings) = read(vec![file]).expect("a volume");
        assert_eq!(volume.hu, expected.hu);
        assert_eq!(volume.grid.lps([0, 0, 0]), expected.grid.lps([0, 0, 0]));
        assert!(!has(&warnings, WarningCode::OddEncoding), "UN is no fault");
    }
}

#[test]
fn no_frames_in_a_class_without_frames_are_one() {
    let plain = read(with(&[], EXPLICIT)).expect("a volume").0;
    for (text, warns) in [("0", true), ("", false), ("1", false), ("01", false)] {
        let files = with(&DataSet::default().text((0x0028, 0x0008), "IS", text).0, EXPLICIT);
        let header = scan(Cursor::new(&files[0]), &Encoding::Part10, &Limits::default()).expect(text).header;
        assert_eq!(header.frames, 1, "{text}");
        let (volume, warnings) = read(files).unwrap_or_else(|error| panic!("{text:?}: {error}"));
        assert_eq!(volume.hu, plain.hu, "{text}");
        assert_eq!(has(&warnings, WarningCode::ZeroFrames), warns, "{text}");
    }
    let none = identity(ENHANCED_CT, "1.2.3.4").text((0x0028, 0x0008), "IS", "0");
    let none = none.part10(ENHANCED_CT, "1.2.3.4", EXPLICIT);
    let refused = scan(Cursor::new(none), &Encoding::Part10, &Limits::default());
    assert!(
        matches!(refused, Err(ScanError::Missing { attribute }) if attribute.starts_with("NumberOfFrames"))
    );
}

#[test]
fn a_rescale_type_other_than_hounsfield_units_is_named() {
    let typed = |text: &str| read(with(&DataSet::default().text((0x0028, 0x1054), "LO", text).0, EXPLICIT));
    for text in ["HU", "hu", "Hounsfield", "hounsfield units", "US"] {
        assert!(typed(text).is_ok(), "{text}");
    }
    for (text, kind) in
        [("OD", "optical density"), ("Z_EFF", "effective atomic number"), ("ZQMARK", "does not define")]
    {
        let error = typed(text).expect_err(text);
        assert_eq!((error.code(), error.instances().len()), ("no_rescale", 5), "{error}");
        assert!(error.to_string().contains("RescaleType (0028,1054)"), "{error}");
        assert!(error.to_string().contains(kind) && !error.to_string().contains("ZQMARK"), "{error}");
    }
}

#[test]
fn padding_with_a_value_of_tissue_is_told() {
    // Stored 100 to 123 are 76 to 99 HU.
    let padded = |value: i16| {
        let (_, warnings) =
            read(with(&DataSet::default().put((0x0028, 0x0120), "SS", &value.to_le_bytes()).0, EXPLICIT))
                .expect("a volume");
        let warning = warnings.into_iter().find(|warning| warning.code == WarningCode::Padding);
        warning.map(|warning| warning.detail)
    };
    let detail = padded(100).expect("a warning");
    assert!(
        detail.starts_with("1 pixels") && detail.contains("1 of them have a value of tissue"),
        "{detail}"
    );
    assert_eq!(padded(-2000), None);
}
