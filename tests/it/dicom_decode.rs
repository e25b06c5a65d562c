//! Decoded values: pydicom is the judge (see tests/tools/pydicom_values.py).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};
use triplanar::dicom::content_digest;
use triplanar::dicom::pixels::{PixelError, stored_values};
use triplanar::dicom::scan::Limits;

use crate::support::data;
use crate::support::dicom::{DataSet, ENHANCED_CT, identity};

const UNCOMPRESSED: &str =
    "cornerstone3d_CTImage/CTImage.dcm_LittleEndianExplicitTransferSyntax_1.2.840.10008.1.2.1.dcm";

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("it/fixtures")
}

/// File → SHA-256 of what pydicom decodes.
fn judged(folder: &str) -> BTreeMap<String, String> {
    let json = std::fs::read(fixtures().join("pydicom_values.json")).expect("the table");
    let mut tables: BTreeMap<String, BTreeMap<String, String>> =
        serde_json::from_slice(&json).expect("the table");
    tables.remove(folder).expect("the folder's table")
}

fn decode(path: &Path) -> Result<Vec<Vec<i32>>, PixelError> {
    stored_values(&std::fs::read(path).expect("the file"), &Limits::default())
}

fn sha256(frames: &[Vec<i32>]) -> String {
    let mut digest = Sha256::new();
    for value in frames.iter().flatten() {
        digest.update(value.to_le_bytes());
    }
    hex::encode(digest.finalize())
}

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn every_file_of_a_supported_syntax_has_pydicoms_values() {
    let data = data::dir();
    let (mut equal, mut refused) = (0, 0);
    for (file, expected) in judged("syntax") {
        let is_jpeg = ["4.50", "4.51"].iter().any(|end| file.contains(end)) || file.contains("jpeg_baseline");
        let is_jpegls = file.contains("JPEGLS") || file.contains("JLSL");
        match decode(&data.join("syntax").join(&file)) {
            Ok(frames) => {
                assert_eq!(sha256(&frames), expected, "{file} decodes to other values than pydicom's");
                equal += 1;
            }
            Err(error) => {
                assert!(is_jpeg || (is_jpegls && cfg!(not(feature = "jpegls"))), "{file}: {error}");
                assert!(error.to_string().contains("can't be decoded here"), "{file}: {error}");
                refused += 1;
            }
        }
    }
    assert_eq!((equal, refused), if cfg!(feature = "jpegls") { (25, 3) } else { (22, 6) });
}

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn retired_and_absent_pixels_give_their_error() {
    let data = data::dir();
    for (file, words) in [
        (
            "cornerstone3d_CTImage/CTImage.dcm_JPEGProcess6_8TransferSyntax_1.2.840.10008.1.2.4.53.dcm",
            "4.53 can't be",
        ),
        (
            "cornerstone3d_CTImage/CTImage.dcm_JPEGProcess10_12TransferSyntax_1.2.840.10008.1.2.4.55.dcm",
            "4.55 can't be",
        ),
        ("misc/no-pixel-data.dcm", "there is no pixel data"),
    ] {
        let error = decode(&data.join("syntax").join(file)).expect_err(file);
        assert!(error.to_string().contains(words), "{file}: {error}");
    }
}

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn lossy_values_are_near_the_original() {
    let data = data::dir();
    let original = decode(&data.join("syntax").join(UNCOMPRESSED)).expect("the original");
    for (name, bound) in [
        ("JPEG2000TransferSyntax_1.2.840.10008.1.2.4.91", 5),
        ("JPEGLSLossyTransferSyntax_1.2.840.10008.1.2.4.81", 1),
    ] {
        let file = data.join(format!("syntax/cornerstone3d_CTImage/CTImage.dcm_{name}.dcm"));
        if name.starts_with("JPEGLS") && cfg!(not(feature = "jpegls")) {
            continue;
        }
        let lossy = decode(&file).expect("lossy values");
        let worst = original[0].iter().zip(&lossy[0]).map(|(a, b)| (a - b).abs()).max();
        assert!(worst <= Some(bound), "{name} is off by {worst:?}, more than {bound}");
    }
}

#[test]
fn high_throughput_jpeg_2000_has_openjpegs_values() {
    let table = judged("htj2k");
    assert_eq!(table.len(), 3);
    for (file, expected) in table {
        let frames =
            decode(&fixtures().join("htj2k").join(&file)).unwrap_or_else(|error| panic!("{file}: {error}"));
        assert_eq!(sha256(&frames), expected, "{file} decodes to other values than pydicom's");
    }
}

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn a_lossless_recompression_has_the_same_content_digest_and_a_changed_pixel_has_not() {
    let data = data::dir();
    let folder = data.join("syntax/cornerstone3d_CTImage");
    let digest = |bytes: &[u8]| content_digest(bytes, &Limits::default()).expect("a digest");
    let original = std::fs::read(data.join("syntax").join(UNCOMPRESSED)).expect("the file");
    for name in [
        "RLELosslessTransferSyntax_1.2.840.10008.1.2.5",
        "DeflatedExplicitVRLittleEndianTransferSyntax_1.2.840.10008.1.2.1.99",
    ] {
        let other = std::fs::read(folder.join(format!("CTImage.dcm_{name}.dcm"))).expect("the file");
        assert_eq!(digest(&other), digest(&original), "{name}");
    }
    let mut changed = original.clone();
    let last = changed.len() - 1000;
    changed[last] ^= 1;
    assert_ne!(digest(&changed), digest(&original));
    let position = original.windows(4).position(|bytes| bytes == [0x20, 0, 0x32, 0]).expect("the position");
    let mut moved = original;
    moved[position + 9] = if moved[position + 9] == b'9' { b'8' } else { b'9' };
    assert_ne!(digest(&moved), digest(&changed));
}

/// Describes `frames` frames of 96 x 64 pixels, as the HTJ2K fixtures have them.
fn enhanced(frames: usize, signed: u16, allocated: u16) -> DataSet {
    identity(ENHANCED_CT, "1.2.3.4")
        .number((0x0028, 0x0002), 1)
        .text((0x0028, 0x0004), "CS", "MONOCHROME2")
        .text((0x0028, 0x0008), "IS", &frames.to_string())
        .number((0x0028, 0x0010), 64)
        .number((0x0028, 0x0011), 96)
        .number((0x0028, 0x0100), allocated)
        .number((0x0028, 0x0101), allocated)
        .number((0x0028, 0x0102), allocated - 1)
        .number((0x0028, 0x0103), signed)
}

/// The compressed stream of a fixture: its last fragment.
fn stream(name: &str) -> Vec<u8> {
    let file = std::fs::read(fixtures().join("htj2k").join(name)).expect("the fixture");
    let start = file.windows(4).position(|bytes| bytes == [0xFF, 0x4F, 0xFF, 0x51]).expect("a codestream");
    file[start..file.len() - 8].to_vec()
}

#[test]
fn fragments_become_frames_with_and_without_an_offset_table() {
    let (a, b) = (stream("lossless_unsigned_rpcl.dcm"), stream("lossy_unsigned.dcm"));
    let one = |name| decode(&fixtures().join("htj2k").join(name)).expect("a fixture").remove(0);
    let expected =
        [one("lossless_unsigned_rpcl.dcm"), one("lossy_unsigned.dcm"), one("lossless_unsigned_rpcl.dcm")];
    // Cut at even places: 2 + 1 + 3 fragments.
    let fragments = [&a[..1000], &a[1000..], &b[..], &a[..10], &a[10..2000], &a[2000..]];
    let starts = |item: usize| -> u64 {
        fragments[..item].iter().map(|fragment| fragment.len().next_multiple_of(2) as u64 + 8).sum()
    };
    let offsets = [starts(0), starts(2), starts(3)];
    let basic: Vec<u8> = offsets.iter().flat_map(|offset| (*offset as u32).to_le_bytes()).collect();
    let extended: Vec<u8> = offsets.iter().flat_map(|offset| offset.to_le_bytes()).collect();
    let wrong: Vec<u8> = [0_u32, 5, 7].iter().flat_map(|offset| offset.to_le_bytes()).collect();
    let syntax = "1.2.840.10008.1.2.4.203";
    for (what, data_set) in [
        ("no table", enhanced(3, 0, 16).fragments(&[], &fragments)),
        ("a basic table", enhanced(3, 0, 16).fragments(&basic, &fragments)),
        ("a wrong table", enhanced(3, 0, 16).fragments(&wrong, &fragments)),
        (
            "an extended table",
            enhanced(3, 0, 16).put((0x7FE0, 0x0001), "OV", &extended).fragments(&[], &fragments),
        ),
        ("one fragment a frame", enhanced(3, 0, 16).fragments(&[], &[&a, &b, &a])),
    ] {
        let file = data_set.part10(ENHANCED_CT, "1.2.3.4", syntax);
        let frames =
            stored_values(&file, &Limits::default()).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert!(frames == expected, "{what}: other values than those of the single frames");
    }
    let missing = enhanced(4, 0, 16).fragments(&[], &fragments).part10(ENHANCED_CT, "1.2.3.4", syntax);
    let error = stored_values(&missing, &Limits::default()).expect_err("only three frames");
    assert!(error.to_string().contains("can't be told apart into 4 frames"), "{error}");
}

#[test]
fn a_stream_of_another_size_than_the_data_set_says_is_refused() {
    let stream = stream("lossless_signed.dcm");
    let mut bomb = stream.clone();
    // Height and width of the SIZ segment: 60 000 x 60 000.
    bomb[8..16].copy_from_slice(&[0, 0, 0xEA, 0x60, 0, 0, 0xEA, 0x60]);
    for stream in [bomb, stream[..60].to_vec(), b"nothing".to_vec()] {
        let file = enhanced(1, 1, 16).fragments(&[], &[&stream]).part10(
            ENHANCED_CT,
            "1.2.3.4",
            "1.2.840.10008.1.2.4.201",
        );
        let error = stored_values(&file, &Limits::default()).expect_err("another size");
        assert!(matches!(error, PixelError::Decode(_)), "{error}");
    }
    let claims = identity(ENHANCED_CT, "1.2.3.4")
        .number((0x0028, 0x0010), 65535)
        .number((0x0028, 0x0011), 65535)
        .number((0x0028, 0x0100), 16)
        .fragments(&[], &[&[2, 0, 0, 0, 64, 0, 0, 0, 66, 0, 0, 0]])
        .part10(ENHANCED_CT, "1.2.3.4", "1.2.840.10008.1.2.5");
    let error = stored_values(&claims, &Limits::default()).expect_err("4 gigapixels");
    assert!(matches!(error, PixelError::Description(_)), "{error}");
}

#[test]
fn a_shortened_stream_is_refused() {
    for (name, syntax) in [
        ("lossless_signed.dcm", "1.2.840.10008.1.2.4.201"),
        ("lossless_unsigned_rpcl.dcm", "1.2.840.10008.1.2.4.202"),
        ("lossy_unsigned.dcm", "1.2.840.10008.1.2.4.203"),
    ] {
        let whole = stream(name);
        for percent in [5, 20, 50, 80, 95, 99] {
            let cut = &whole[..whole.len() * percent / 100];
            let file = enhanced(1, u16::from(name == "lossless_signed.dcm"), 16)
                .fragments(&[], &[cut])
                .part10(ENHANCED_CT, "1.2.3.4", syntax);
            let error = stored_values(&file, &Limits::default()).expect_err("a part of a stream");
            assert!(matches!(error, PixelError::Decode(_)), "{name}, {percent} %: {error}");
        }
    }
}

#[test]
fn rle_is_what_the_standard_says() {
    // Two rows of two 16-bit pixels: 0x0102, 0x0102, 0x0102, 0x0304 (PS3.5 section G): most
    // significant bytes 01 01 01 03, then least significant 02 02 02 04.
    let mut frame = vec![2, 0, 0, 0, 64, 0, 0, 0, 68, 0, 0, 0];
    frame.resize(64, 0);
    frame.extend([0xFE, 0x01, 0x00, 0x03]);
    frame.extend([0x80, 0x03, 0x02, 0x02, 0x02, 0x04]);
    let file = |frame: &[u8]| {
        identity(ENHANCED_CT, "1.2.3.4")
            .number((0x0028, 0x0010), 2)
            .number((0x0028, 0x0011), 2)
            .number((0x0028, 0x0100), 16)
            .fragments(&[], &[frame])
            .part10(ENHANCED_CT, "1.2.3.4", "1.2.840.10008.1.2.5")
    };
    let expected = [[0x0102, 0x0102, 0x0102, 0x0304]];
    assert_eq!(stored_values(&file(&frame), &Limits::default()).expect("valid"), expected);
    let padded = [&frame[..], &[0x80, 0, 0, 0]].concat();
    assert_eq!(stored_values(&file(&padded), &Limits::default()).expect("padding is no pixel"), expected);
    // A pixel more: after the last, or in its run.
    let mut longer = frame.clone();
    longer[69] += 1;
    for more in [[&frame[..], &[0, 9]].concat(), [&longer[..], &[9]].concat()] {
        let error = stored_values(&file(&more), &Limits::default()).expect_err("a pixel more");
        assert!(error.to_string().contains("RLE"), "{error}");
    }
    for cut in [0, 3, 11, 63, 66, 69, 72] {
        let error = stored_values(&file(&frame[..cut]), &Limits::default()).expect_err("cut off");
        assert!(matches!(error, PixelError::Decode(_) | PixelError::Extent(_)), "{error}");
    }
}

#[test]
fn corrupt_streams_are_errors_and_nothing_worse() {
    corrupt(std::fs::read(fixtures().join("htj2k/lossless_signed.dcm")).expect("the fixture"));
}

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn corrupt_streams_of_every_codec_are_errors_and_nothing_worse() {
    let data = data::dir();
    for name in [
        "cornerstone3d_CTImage/CTImage.dcm_JPEGProcess14SV1TransferSyntax_1.2.840.10008.1.2.4.70.dcm",
        "cornerstone3d_CTImage/CTImage.dcm_RLELosslessTransferSyntax_1.2.840.10008.1.2.5.dcm",
        "pydicom/693_J2KI.dcm",
    ] {
        corrupt(std::fs::read(data.join("syntax").join(name)).expect("the file"));
    }
}

/// Decodes the file with random bytes in it, again and again.
fn corrupt(file: Vec<u8>) {
    let mut state = 1_u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as usize
    };
    for _ in 0..12 {
        let mut corrupt = file.clone();
        for _ in 0..20 {
            let at = corrupt.len() - 1 - random() % (corrupt.len() * 2 / 3).min(100_000);
            corrupt[at] = random() as u8;
        }
        let _ = stored_values(&corrupt, &Limits::default());
    }
}
