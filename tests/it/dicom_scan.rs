//! The bounded scan: what is valid passes, what would hurt is refused with its error.

use std::io::{Cursor, Read, Seek, SeekFrom, Write};

use flate2::Compression;
use flate2::write::DeflateEncoder;
use proptest::prelude::*;
use triplanar::dicom::scan::{Encoding, Limits, Scan, ScanError, scan};
use triplanar::dicom::{content_digest, pixels};

use crate::support::data;
use crate::support::dicom::{CT, DataSet, EXPLICIT, identity};

const DEFLATED: &str = "1.2.840.10008.1.2.1.99";

fn scanned(bytes: &[u8], encoding: &Encoding) -> Result<Scan, ScanError> {
    scan(Cursor::new(bytes), encoding, &Limits::default())
}

fn bare(transfer_syntax: &str) -> Encoding {
    Encoding::DataSet(transfer_syntax.parse().expect("a UID"))
}

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn every_file_passes_or_is_refused_for_its_documented_reason() {
    let data = data::dir();
    let mut refused = Vec::new();
    for folder in ["cornerstone3d_CTImage", "pydicom", "misc"] {
        for entry in std::fs::read_dir(data.join("syntax").join(folder)).expect("the folder") {
            let path = entry.expect("an entry").path();
            let file = std::fs::File::open(&path).expect("the file");
            let name = path.file_name().expect("a name").to_string_lossy().into_owned();
            match scan(file, &Encoding::Part10, &Limits::default()) {
                Ok(scan) => assert_eq!(scan.header.has_pixel_data, name != "no-pixel-data.dcm", "{name}"),
                Err(ScanError::UnsupportedTransferSyntax(uid)) => refused.push(uid.to_string()),
                Err(ScanError::Missing { attribute }) => {
                    let wanted = match name.as_str() {
                        // A hash in hexadecimal digits.
                        "bad_sequence.dcm" => "SOPInstanceUID (0008,0018)",
                        // A bare picture of a codec's test suite.
                        "JLSL_16_15_1_1F.dcm" => "StudyInstanceUID (0020,000D)",
                        _ => panic!("{name}: no {attribute}"),
                    };
                    assert_eq!(attribute, wanted, "{name}");
                }
                Err(error) => panic!("{name}: {error:?}"),
            }
        }
    }
    refused.sort();
    refused.dedup();
    let mut expected = vec![".50", ".51", ".53", ".55"];
    if cfg!(not(feature = "jpegls")) {
        expected.extend([".80", ".81"]);
    }
    assert_eq!(refused, expected.iter().map(|end| format!("1.2.840.10008.1.2.4{end}")).collect::<Vec<_>>());
}

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn every_instance_of_the_series_passes() {
    let data = data::dir();
    for name in
        ["ge_hispeed_tilt_variable", "philips_phantom_tilt_m18", "phantom_4", "imagex_siemens_phantom_2mm"]
    {
        for (path, bytes) in data::series(&data, name, "") {
            if path != "DIRFILE" {
                let scan =
                    scanned(&bytes, &Encoding::Part10).unwrap_or_else(|e| panic!("{name} {path}: {e}"));
                assert_eq!((scan.header.rows, scan.header.columns), (Some(512), Some(512)));
                assert_eq!(scan.header.modality.as_deref(), Some("CT"));
            }
        }
    }
}

#[test]
fn a_header_is_read_the_same_with_and_without_what_stands_before_the_data_set() {
    let data_set = identity(CT, "1.2.3.4")
        .text((0x0008, 0x103E), "LO", "Kopf")
        .text((0x0010, 0x0020), "LO", "P-17")
        .text((0x0028, 0x0008), "IS", "2");
    let file = data_set.part10(CT, "1.2.3.4", EXPLICIT);
    let whole = scanned(&file, &Encoding::Part10).expect("a Part 10 file");
    assert_eq!(whole.data_set_offset, (file.len() - data_set.0.len()) as u64);
    assert_eq!(whole.header.sop_instance_uid.as_str(), "1.2.3.4");
    assert_eq!(whole.header.image_type, ["ORIGINAL", "PRIMARY", "AXIAL"]);
    assert_eq!(whole.header.series_description.as_deref(), Some("Kopf"));
    assert_eq!(whole.header.identity.patient_id.as_deref(), Some("P-17"));
    assert_eq!(whole.header.frames, 2);
    assert!(!whole.header.has_pixel_data);

    for (what, bytes, encoding, offset) in [
        ("no preamble", &file[128..], Encoding::Part10, whole.data_set_offset - 128),
        ("no magic word", &file[132..], Encoding::Part10, whole.data_set_offset - 132),
        ("no meta information", &data_set.0[..], Encoding::Part10, 0),
        ("a bare data set", &data_set.0[..], bare(EXPLICIT), 0),
    ] {
        let found = scanned(bytes, &encoding).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!(found.header, whole.header, "{what}");
        assert_eq!(found.data_set_offset, offset, "{what}");
    }
}

#[test]
fn padding_private_sequences_and_zeros_at_the_end_are_let_through() {
    let undefined = |tag: [u8; 4], vr: &[u8]| [&tag[..], vr, &[0, 0, 0xFF, 0xFF, 0xFF, 0xFF]].concat();
    let delimiter = |element: u8| [0xFE, 0xFF, element, 0xE0, 0, 0, 0, 0];
    let mut data_set = identity(CT, "1.2.3.4").0;
    // A UN sequence of undefined length: implicit VR inside, as is the sequence inside it.
    data_set.extend(undefined([0x09, 0, 0x01, 0x10], b"UN"));
    data_set.extend([0xFE, 0xFF, 0x00, 0xE0, 0xFF, 0xFF, 0xFF, 0xFF]);
    data_set.extend([0x09, 0, 0x02, 0x10, 4, 0, 0, 0, b'S', b'Q', 1, 2]);
    data_set.extend([0x09, 0, 0x03, 0x10, 0xFF, 0xFF, 0xFF, 0xFF]);
    data_set.extend(delimiter(0xDD));
    data_set.extend(delimiter(0x0D));
    data_set.extend(delimiter(0xDD));
    let mut data_set = DataSet(data_set).put((0xFFFC, 0xFFFC), "OB", &[0; 64]).0;
    data_set.extend([0; 333]);
    let scan = scanned(&data_set, &bare(EXPLICIT)).expect("all of it is valid");
    assert_eq!(scan.header.sop_instance_uid.as_str(), "1.2.3.4");

    data_set.push(1);
    assert!(matches!(scanned(&data_set, &bare(EXPLICIT)), Err(ScanError::Malformed(_))), "not only zeros");
}

#[test]
fn text_is_read_in_the_character_set_of_the_data_set() {
    let named = DataSet::default().text((0x0008, 0x0005), "CS", "ISO_IR 100");
    let named =
        DataSet([named.0, identity(CT, "1.2.3.4").0].concat()).put((0x0008, 0x103E), "LO", b"Sch\xE4del");
    let scan = scanned(&named.0, &bare(EXPLICIT)).expect("valid");
    assert_eq!(scan.header.series_description.as_deref(), Some("Sch\u{e4}del"));
}

#[test]
fn what_an_instance_cannot_be_filed_without_is_named() {
    for (tag, attribute) in [
        ((0x0008, 0x0016), "SOPClassUID (0008,0016)"),
        ((0x0008, 0x0018), "SOPInstanceUID (0008,0018)"),
        ((0x0020, 0x000D), "StudyInstanceUID (0020,000D)"),
        ((0x0020, 0x000E), "SeriesInstanceUID (0020,000E)"),
    ] {
        // The first of two counts, and it is no UID.
        let data_set =
            DataSet([DataSet::default().text(tag, "UI", "none").0, identity(CT, "1.2.3.4").0].concat());
        match scanned(&data_set.0, &bare(EXPLICIT)) {
            Err(ScanError::Missing { attribute: named }) => assert_eq!(named, attribute),
            other => panic!("{attribute}: {other:?}"),
        }
    }
}

#[test]
fn text_and_empty_files_are_no_dicom() {
    for bytes in [&b""[..], b"hello", &[0; 4096], &b"PK\x03\x04 a zip".repeat(40)] {
        assert!(matches!(scanned(bytes, &Encoding::Part10), Err(ScanError::NotDicom(_))));
    }
}

/// Asserts that nobody asks for more bytes at a time than a buffer holds, whatever is claimed.
struct SmallReads<R>(R);

impl<R: Read> Read for SmallReads<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        assert!(buffer.len() <= 64 * 1024, "{} bytes were allocated at once", buffer.len());
        self.0.read(buffer)
    }
}

impl<R: Seek> Seek for SmallReads<R> {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.0.seek(to)
    }
}

fn malformed(bytes: &[u8], encoding: &Encoding) -> String {
    match scan(SmallReads(Cursor::new(bytes)), encoding, &Limits::default()) {
        Err(ScanError::Malformed(detail)) => detail,
        other => panic!("not refused as malformed: {other:?}"),
    }
}

#[test]
fn thousands_of_nested_sequences_are_refused() {
    let header = identity(CT, "1.2.3.4");
    let mut undefined = header.0.clone();
    for _ in 0..8000 {
        undefined.extend([0x40, 0, 0x30, 0xA7, b'S', b'Q', 0, 0, 0xFF, 0xFF, 0xFF, 0xFF]);
        undefined.extend([0xFE, 0xFF, 0x00, 0xE0, 0xFF, 0xFF, 0xFF, 0xFF]);
    }
    let mut defined = DataSet::default();
    for _ in 0..8000 {
        defined = DataSet::default().sequence((0x0040, 0xA730), &[defined]);
    }
    let defined = [header.0, defined.0].concat();
    for bytes in [undefined, defined] {
        let detail = malformed(&bytes, &bare(EXPLICIT));
        assert!(detail.contains("nested more than 32 deep"), "{detail}");
    }
}

#[test]
fn a_small_file_that_claims_4_gigabytes_is_refused() {
    for (what, vr, length) in [
        ("a value", *b"OW", 0xFFFF_FFF0_u32),
        ("a sequence", *b"SQ", 0xFFFF_FFF0),
        ("a text", *b"UT", 0xFFFF_FFF0),
        ("a value, just too long", *b"OB", 4097),
    ] {
        let mut bytes = identity(CT, "1.2.3.4").0;
        bytes.extend([0x09, 0, 0x10, 0x10]);
        bytes.extend(vr);
        bytes.extend([0, 0]);
        bytes.extend(length.to_le_bytes());
        bytes.extend(vec![0; if length == 4097 { 4096 } else { 512 }]);
        let detail = malformed(&bytes, &bare(EXPLICIT));
        assert!(detail.contains("claims"), "{what}: {detail}");
    }
    // Inside an item whose own length is shorter.
    let inner = DataSet::default().put((0x0008, 0x0100), "UN", &[0; 40]);
    let mut bytes = identity(CT, "1.2.3.4").sequence((0x5200, 0x9230), &[inner]).0;
    let claim = bytes.len() - 44;
    bytes[claim..claim + 4].copy_from_slice(&60_u32.to_le_bytes());
    assert!(malformed(&bytes, &bare(EXPLICIT)).contains("claims 60 bytes where 40 are left"));
}

#[test]
fn a_header_attribute_of_megabytes_is_not_read() {
    let bytes = identity(CT, "1.2.3.4").put((0x0010, 0x0020), "UN", &vec![b'1'; 1 << 20]).0;
    assert!(malformed(&bytes, &bare(EXPLICIT)).contains("more than 4096"));
}

fn deflated(data_set: &[u8]) -> Vec<u8> {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(data_set).expect("memory");
    encoder.finish().expect("memory")
}

#[test]
fn a_deflate_bomb_is_refused_at_its_limit() {
    // 64 MiB of zeros in 64 KiB.
    let data_set = identity(CT, "1.2.3.4").put((0x7FE0, 0x0010), "OW", &vec![0; 64 << 20]);
    let file = DataSet(deflated(&data_set.0)).part10(CT, "1.2.3.4", DEFLATED);
    assert!(file.len() < 100_000);
    assert!(scanned(&file, &Encoding::Part10).expect("below the limit").header.has_pixel_data);
    let limits = Limits { max_inflated_bytes: 1 << 20, ..Limits::default() };
    let refused = scan(SmallReads(Cursor::new(&file)), &Encoding::Part10, &limits);
    assert!(matches!(refused, Err(ScanError::InflatesTooMuch { limit_bytes }) if limit_bytes == 1 << 20));
    let refused = content_digest(&file, &limits).expect_err("the reader has the same limit");
    assert!(refused.to_string().contains("inflates to more than"), "{refused}");

    // A bomb of many elements instead of one long one, and one that is cut off.
    let many =
        DataSet([identity(CT, "1.2.3.4").0, [9, 0, 16, 16, b'L', b'O', 0, 0].repeat(3_000_000)].concat());
    let bomb = deflated(&many.0);
    assert!(malformed(&bomb, &bare(DEFLATED)).contains("more than 2000000 elements"));
    let cut = deflated(&data_set.0);
    let detail = malformed(&cut[..cut.len() / 2], &bare(DEFLATED));
    assert!(detail.contains("ends in the middle") || detail.contains("inflated"), "{detail}");
}

fn small_instance() -> Vec<u8> {
    let groups = DataSet::default()
        .sequence((0x0020, 0x9113), &[DataSet::default().decimals((0x0020, 0x0032), &[1.0, 2.0, 3.0])]);
    identity(CT, "1.2.3.4")
        .number((0x0028, 0x0010), 4)
        .number((0x0028, 0x0011), 4)
        .number((0x0028, 0x0100), 16)
        .sequence((0x5200, 0x9230), &[groups.clone(), groups])
        .fragments(&[], &[&[1; 20], &[2; 8]])
        .part10(CT, "1.2.3.4", "1.2.840.10008.1.2.5")
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_never_panic(
        bytes in proptest::collection::vec(any::<u8>(), 0..600),
        syntax in proptest::sample::select(vec![
            "1.2.840.10008.1.2", EXPLICIT, "1.2.840.10008.1.2.2", DEFLATED,
        ]),
    ) {
        let _ = scan(SmallReads(Cursor::new(&bytes)), &bare(syntax), &Limits::default());
        let _ = scan(SmallReads(Cursor::new(&bytes)), &Encoding::Part10, &Limits::default());
    }

    #[test]
    fn a_mutated_instance_never_panics(
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in any::<prop::sample::Index>(),
    ) {
        let mut bytes = small_instance();
        for (index, value) in changes {
            // Not in the preamble, where nothing happens.
            let at = 128 + index.index(bytes.len() - 128);
            bytes[at] = value;
        }
        let _ = scan(SmallReads(Cursor::new(&bytes)), &Encoding::Part10, &Limits::default());
        let _ = pixels::stored_values(&bytes, &Limits::default());
        let _ = content_digest(&bytes, &Limits::default());
        let cut = &bytes[..cut.index(bytes.len())];
        let _ = scan(SmallReads(Cursor::new(cut)), &Encoding::Part10, &Limits::default());
    }
}
