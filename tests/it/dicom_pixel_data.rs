//! Pixel data that is not what its description says: refused at receipt, or in the job, or told.

use tempfile::tempdir;
use triplanar::dicom::Volume;
use triplanar::dicom::pixels::{PixelError, stored_values};
use triplanar::dicom::scan::Limits;
use triplanar::dicom::series::{self, ReadLimits, SeriesError, Warning, WarningCode};
use triplanar::error::Error;
use triplanar::observer::Silent;
use uuid::Uuid;

use crate::support::dicom::{CT, DataSet, EXPLICIT, Memory, Slice, identity};
use crate::support::entrance::{Entrance, settings};
use crate::support::jpeg_lossless::{Codes, Encoding, encode};

const BIG_ENDIAN: &str = "1.2.840.10008.1.2.2";
const DEFLATED: &str = "1.2.840.10008.1.2.1.99";
const JPEG_LOSSLESS: &str = "1.2.840.10008.1.2.4.70";
const RLE: &str = "1.2.840.10008.1.2.5";

/// How pixels are stored: rows, columns, frames, bits allocated, stored, high bit, sign.
#[derive(Clone, Copy)]
struct Layout(u16, u16, u32, u16, u16, u16, bool);

/// 3 x 5 pixels of 16 bits.
const WORDS: Layout = Layout(3, 5, 1, 16, 16, 15, true);

impl Layout {
    fn described(self) -> DataSet {
        let Self(rows, columns, frames, allocated, stored, high_bit, signed) = self;
        identity(CT, "1.2.3.4")
            .number((0x0028, 0x0002), 1)
            .text((0x0028, 0x0004), "CS", "MONOCHROME2")
            .text((0x0028, 0x0008), "IS", &frames.to_string())
            .number((0x0028, 0x0010), rows)
            .number((0x0028, 0x0011), columns)
            .number((0x0028, 0x0100), allocated)
            .number((0x0028, 0x0101), stored)
            .number((0x0028, 0x0102), high_bit)
            .number((0x0028, 0x0103), u16::from(signed))
    }

    fn native(self, pixels: &[u8]) -> Vec<u8> {
        self.described().put((0x7FE0, 0x0010), "OW", pixels).part10(CT, "1.2.3.4", EXPLICIT)
    }
}

fn deflated(data_set: &DataSet) -> Vec<u8> {
    use std::io::Write as _;
    let mut deflated = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::fast());
    deflated.write_all(&data_set.0).expect("memory");
    DataSet(deflated.finish().expect("memory")).part10(CT, "1.2.3.4", DEFLATED)
}

/// Files that must be refused at receipt, and in the job if an older version stored them.
fn refused() -> Vec<(&'static str, Vec<u8>)> {
    let ones = |count: usize| vec![1; count];
    let zeros_then_one = |zeros: usize| [ones(30), vec![0; zeros], ones(1)].concat();
    let three_frames = Layout(3, 5, 3, 16, 16, 15, true);
    let odd_bytes = Layout(3, 5, 1, 8, 8, 7, false);
    let odd_frames = Layout(3, 5, 4, 8, 8, 7, false);
    let half = WORDS.described().put((0x7FE0, 0x0010), "OW", &ones(14));
    let frames = |fragments: &[&[u8]]| {
        three_frames.described().fragments(&[], fragments).part10(CT, "1.2.3.4", JPEG_LOSSLESS)
    };
    vec![
        ("half an image", WORDS.native(&ones(14))),
        ("a pixel too few", WORDS.native(&ones(28))),
        ("a frame too few", three_frames.native(&ones(60))),
        ("frames without end", Layout(3, 5, u32::MAX, 16, 16, 15, true).native(&ones(90))),
        ("an 8-bit pixel too few", odd_bytes.native(&ones(14))),
        ("bytes for words", Layout(4, 4, 1, 16, 16, 15, true).native(&ones(16))),
        ("words for bytes", Layout(4, 4, 1, 8, 8, 7, false).native(&ones(32))),
        ("a pixel too many", WORDS.native(&ones(32))),
        ("rows that are not counted", WORDS.native(&ones(60))),
        ("something after zeros", WORDS.native(&zeros_then_one(4097))),
        ("padding after each frame", odd_frames.native(&ones(64))),
        ("half an image, deflated", deflated(&half)),
        ("fewer fragments than frames", frames(&[&[0xFF, 0xD8], &[0xFF, 0xD8]])),
        ("empty fragments", frames(&[&[0xFF, 0xD8], &[0xFF, 0xD8], &[]])),
        ("no fragment", WORDS.described().fragments(&[], &[]).part10(CT, "1.2.3.4", RLE)),
    ]
}

#[tokio::test]
async fn an_image_that_is_not_whole_is_refused_at_receipt() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    for (what, file) in refused() {
        let error = entrance.upload(Uuid::new_v4(), &file).await.expect_err(what);
        assert!(matches!(error, Error::PixelDataSize(_)), "{what}: {error}");
        let mapping = error.mapping();
        assert_eq!((mapping.dimse_status, mapping.http_status), (0xC007, 422), "{what}");
    }
    assert!(entrance.store.instances(&"1.2.3.2".parse().unwrap()).await.unwrap().is_empty());
    let whole = [WORDS.native(&[1; 30]), WORDS.native(&[[1; 30], [0; 30]].concat())];
    for file in whole {
        let other = Uuid::new_v4();
        entrance.upload(other, &file).await.expect("whole, with or without zeros");
    }
}

#[test]
fn an_image_that_is_not_whole_is_refused_in_the_job() {
    for (what, file) in refused() {
        let error = stored_values(&file, &Limits::default()).expect_err(what);
        assert!(matches!(error, PixelError::Extent(_)), "{what}: {error}");
    }
}

#[test]
fn the_padding_byte_is_no_pixel() {
    let odd = Layout(1, 3, 3, 8, 8, 7, false);
    let pixels = [1, 2, 3, 4, 5, 6, 7, 8, 9];
    let expected = [[1, 2, 3], [4, 5, 6], [7, 8, 9]];
    for pad in [0, 77] {
        let file = odd.native(&[&pixels[..], &[pad]].concat());
        assert_eq!(stored_values(&file, &Limits::default()).expect("values"), expected);
    }
    // Big endian words of two pixels (PS3.5 section 8.1.1): the padding is before the last pixel.
    let swapped = [2, 1, 4, 3, 6, 5, 8, 7, 0, 9];
    let data_set = odd.described().put((0x7FE0, 0x0010), "OW", &swapped);
    let file = big_endian(&data_set).part10(CT, "1.2.3.4", BIG_ENDIAN);
    assert_eq!(stored_values(&file, &Limits::default()).expect("values"), expected);
}

/// The same elements with big-endian tags, lengths and numbers.
fn big_endian(data_set: &DataSet) -> DataSet {
    let (mut from, mut to) = (&data_set.0[..], Vec::new());
    while !from.is_empty() {
        to.extend([from[1], from[0], from[3], from[2], from[4], from[5]]);
        let (length, head) = if &from[4..6] == b"OW" {
            to.extend([0, 0, from[11], from[10], from[9], from[8]]);
            (u32::from_le_bytes(from[8..12].try_into().expect("4 bytes")) as usize, 12)
        } else {
            to.extend([from[7], from[6]]);
            (usize::from(u16::from_le_bytes([from[6], from[7]])), 8)
        };
        let value = &from[head..head + length];
        if &from[4..6] == b"US" {
            to.extend([value[1], value[0]])
        } else {
            to.extend(value)
        }
        from = &from[head + length..];
    }
    DataSet(to)
}

/// Three slices, of which the second has those pixels.
fn series(layout: Layout, pixels: &[u16]) -> Vec<Vec<u8>> {
    let slice = |index: usize| {
        let uid = format!("1.2.3.4.{index}");
        let slice = Slice {
            uid: uid.clone(),
            position: [0.0, 0.0, 2.0 * index as f64],
            orientation: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            spacing: [1.0, 1.0],
            rows: layout.0,
            columns: layout.1,
            values: Vec::new(),
        };
        let whole = usize::from(layout.0) * usize::from(layout.1);
        let words = if index == 1 { pixels.to_vec() } else { vec![index as u16; whole] };
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let mut file = slice
            .described(identity(CT, &uid))
            .put((0x7FE0, 0x0010), "OW", &bytes)
            .part10(CT, &uid, EXPLICIT);
        for (element, value) in [(1, layout.4), (2, layout.5), (3, u16::from(layout.6))] {
            let tag = [0x28, 0, element, 1, b'U', b'S', 2, 0];
            let at = file.windows(8).position(|bytes| bytes == tag).expect("the element") + 8;
            file[at..at + 2].copy_from_slice(&value.to_le_bytes());
        }
        file
    };
    (0..3).map(slice).collect()
}

fn read(files: Vec<Vec<u8>>) -> Result<(Volume, Vec<Warning>), SeriesError> {
    series::read(&Memory(files), &ReadLimits { min_slices: 3, ..ReadLimits::default() }, &Silent)
}

#[test]
fn zeros_after_the_pixels_are_a_warning_with_the_same_volume() {
    let pixels: Vec<u16> = (1..=15).collect();
    let (whole, warnings) = read(series(WORDS, &pixels)).expect("a volume");
    assert!(warnings.iter().all(|warning| warning.code != WarningCode::TrailingZeros));
    let (longer, warnings) = read(series(WORDS, &[&pixels[..], &[0; 10]].concat())).expect("a volume");
    assert_eq!(whole.hu, longer.hu);
    let warning =
        warnings.iter().find(|warning| warning.code == WarningCode::TrailingZeros).expect("a warning");
    assert!(warning.detail.starts_with("1 instances"), "{}", warning.detail);
    let error = read(series(WORDS, &pixels[..9])).expect_err("half an image");
    assert_eq!(error.code(), "pixel_data_size");
    assert_eq!(error.instances(), ["1.2.3.4.1".parse().expect("a UID")]);
}

#[test]
fn bits_beside_the_values_are_told_or_refused() {
    let twelve = |signed| Layout(1, 4, 1, 16, 12, 11, signed);
    let hu = |volume: &Volume| -> Vec<i16> {
        let z = (0..3).find(|z| volume.hu[[*z, 0, 1]] > 100).expect("the slice");
        (0..4).map(|x| volume.hu[[z, 0, x]] - Slice::INTERCEPT).collect()
    };
    // As pydicom reads them: what is above BitsStored is cut off.
    let (volume, warnings) = read(series(twelve(true), &[0xFC18, 1000, 0x0C18, 5])).expect("a volume");
    assert_eq!(hu(&volume), [-1000, 1000, -1000, 5]);
    assert!(warnings.iter().all(|warning| warning.code != WarningCode::UnusedBits));
    let (volume, warnings) =
        read(series(twelve(false), &[0x4000 | 7, 1000, 0xC000 | 6, 5])).expect("a volume");
    assert_eq!(hu(&volume), [7, 1000, 6, 5]);
    let warning = warnings.iter().find(|warning| warning.code == WarningCode::UnusedBits).expect("a warning");
    assert!(warning.detail.starts_with("2 pixels"), "{}", warning.detail);
    for (signed, words, doubt) in [
        (false, [0xFC18, 1000, 0xFC19, 5], "look signed"),
        (false, [0x1001, 1000, 0x1002, 5], "more bits"),
        (true, [0x1001, 1000, 0x1002, 5], "more bits"),
        (false, [0x8001, 0x8002, 0x8003, 0x8004], "offset"),
        (true, [0x8000, 1000, 0x8000, 5], "special value"),
    ] {
        let error = read(series(twelve(signed), &words)).expect_err(doubt);
        assert_eq!(error.code(), "decode_failed", "{error}");
        assert!(error.to_string().contains(doubt), "{error}");
        assert_eq!(error.instances(), ["1.2.3.4.1".parse().expect("a UID")]);
    }
}

#[test]
fn announced_overlays_do_not_count() {
    let layout = Layout(1, 3, 1, 16, 12, 11, false);
    let words: Vec<u8> = [0x1001_u16, 0x0002, 0x1003].iter().flat_map(|word| word.to_le_bytes()).collect();
    let with = |overlay: DataSet| {
        let data_set = layout.described();
        DataSet([data_set.0, overlay.0].concat())
            .put((0x7FE0, 0x0010), "OW", &words)
            .part10(CT, "1.2.3.4", EXPLICIT)
    };
    let position = |bit| DataSet::default().number((0x6002, 0x0102), bit);
    let announced = with(position(12));
    assert_eq!(stored_values(&announced, &Limits::default()).expect("values"), [[1, 2, 3]]);
    let elsewhere = [position(13), position(12).put((0x6002, 0x3000), "OW", &[0, 0]), DataSet::default()];
    for overlay in elsewhere {
        let error = stored_values(&with(overlay), &Limits::default()).expect_err("not announced there");
        assert!(error.to_string().contains("more bits"), "{error}");
    }
}

#[test]
fn a_decoders_values_beyond_the_bits_stored_are_refused_with_the_instance() {
    // RLE of 2 x 2 pixels: segments of the high and of the low bytes.
    let rle = |high: [u8; 4], low: [u8; 4]| {
        let mut frame = vec![2, 0, 0, 0, 64, 0, 0, 0, 70, 0, 0, 0];
        frame.resize(64, 0);
        frame.extend([3, high[0], high[1], high[2], high[3], 0x80, 3, low[0], low[1], low[2], low[3]]);
        frame
    };
    let decode = |layout: Layout, frame: &[u8], syntax| {
        let file = layout.described().fragments(&[], &[frame]).part10(CT, "1.2.3.4", syntax);
        stored_values(&file, &Limits::default())
    };
    let unsigned = Layout(2, 2, 1, 16, 12, 11, false);
    let signed = Layout(2, 2, 1, 16, 12, 11, true);
    let frames = decode(signed, &rle([0xFC, 0x03, 0x0F, 0], [0x18, 0xE8, 0xFF, 7]), RLE).expect("values");
    assert_eq!(frames, [[-1000, 1000, -1, 7]]);
    for (layout, high) in
        [(unsigned, [0xFC, 3, 0, 0]), (unsigned, [0x40, 0x80, 0, 0]), (signed, [0x13, 0, 0, 0])]
    {
        let error = decode(layout, &rle(high, [1, 2, 3, 4]), RLE).expect_err("beyond");
        assert!(error.to_string().contains("12 bits stored"), "{error}");
    }
    let encoding = Encoding {
        precision: 16,
        selection: 1,
        point_transform: 0,
        restart_rows: 0,
        codes: Codes::Flat,
        ornate: false,
    };
    let stream = encode(&[1, 2, 4096, 3], 2, &encoding);
    let error = decode(unsigned, &stream, JPEG_LOSSLESS).expect_err("beyond");
    assert!(error.to_string().contains("12 bits stored"), "{error}");
}
