//! JPEG Lossless (.57, .70): the samples of an encoder that was written apart from the decoder.

use proptest::prelude::*;
use triplanar::dicom::pixels::{PixelError, stored_values};
use triplanar::dicom::scan::Limits;

use crate::support::dicom::{CT, DataSet, identity};
use crate::support::jpeg_lossless::{Codes, Encoding, encode, expected};

const SELECTION_1: &str = "1.2.840.10008.1.2.4.70";
const ANY_SELECTION: &str = "1.2.840.10008.1.2.4.57";

const PLAIN: Encoding = Encoding {
    precision: 12,
    selection: 1,
    point_transform: 0,
    restart_rows: 0,
    codes: Codes::Flat,
    ornate: false,
};

fn described(rows: usize, columns: usize, stored: u16, signed: bool) -> DataSet {
    let allocated = if stored <= 8 { 8 } else { 16 };
    identity(CT, "1.2.3.4")
        .number((0x0028, 0x0002), 1)
        .text((0x0028, 0x0004), "CS", "MONOCHROME2")
        .number((0x0028, 0x0010), rows as u16)
        .number((0x0028, 0x0011), columns as u16)
        .number((0x0028, 0x0100), allocated)
        .number((0x0028, 0x0101), stored)
        .number((0x0028, 0x0102), stored - 1)
        .number((0x0028, 0x0103), u16::from(signed))
}

fn decode(data_set: &DataSet, stream: &[u8], syntax: &str) -> Result<Vec<i32>, PixelError> {
    let file = data_set.clone().fragments(&[], &[stream]).part10(CT, "1.2.3.4", syntax);
    stored_values(&file, &Limits::default()).map(|mut frames| frames.remove(0))
}

/// Samples that wander and jump, over all values of that many bits.
fn samples(count: usize, precision: u32, seed: u32) -> Vec<u16> {
    let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(1);
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 8
    };
    let mask = (1_u32 << precision) - 1;
    let mut value = random() & mask;
    (0..count)
        .map(|_| {
            value = match random() % 8 {
                0 => random() & mask,
                1 => [0, mask, mask / 2 + 1][random() as usize % 3],
                _ => (value + random() % 5).saturating_sub(2).min(mask),
            };
            value as u16
        })
        .collect()
}

/// The samples without the bits that the point transform cuts off, as numbers of that many bits.
fn values(samples: &[u16], encoding: &Encoding, signed: bool) -> Vec<i32> {
    let wrap = |sample: i32| {
        if signed && sample >> (encoding.precision - 1) == 1 {
            sample - (1 << encoding.precision)
        } else {
            sample
        }
    };
    expected(samples, encoding.point_transform).into_iter().map(|sample| wrap(sample.into())).collect()
}

fn assert_same(rows: usize, columns: usize, encoding: &Encoding, signed: bool, seed: u32) {
    let samples = samples(rows * columns, encoding.precision, seed);
    let stream = encode(&samples, columns, encoding);
    let data_set = described(rows, columns, encoding.precision as u16, signed);
    for syntax in [ANY_SELECTION, SELECTION_1] {
        let decoded = decode(&data_set, &stream, syntax)
            .unwrap_or_else(|error| panic!("{rows} x {columns}, {encoding:?}, signed {signed}: {error}"));
        assert!(
            decoded == values(&samples, encoding, signed),
            "{rows} x {columns}, {encoding:?}, signed {signed}: other samples than were encoded"
        );
    }
}

#[test]
fn every_predictor_precision_and_point_transform_gives_the_encoded_samples() {
    for selection in 1..=7 {
        for precision in 2..=16 {
            for point_transform in 0..precision {
                for restart_rows in [0, 1, 3] {
                    let codes = [Codes::Flat, Codes::ShortFirst, Codes::ShortLast]
                        [(precision + point_transform) as usize % 3];
                    let ornate = restart_rows == 3;
                    let encoding =
                        Encoding { precision, selection, point_transform, restart_rows, codes, ornate };
                    assert_same(8, 7, &encoding, precision % 2 == 0, precision + 100 * point_transform);
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn random_images_give_the_encoded_samples(
        rows in 1_usize..40,
        columns in 1_usize..40,
        precision in 2_u32..=16,
        selection in 1_u8..=7,
        cut in 0_u32..16,
        restart_rows in 0_usize..40,
        codes in prop_oneof![Just(Codes::Flat), Just(Codes::ShortFirst), Just(Codes::ShortLast)],
        ornate: bool,
        signed: bool,
        seed: u32,
    ) {
        let point_transform = cut % precision;
        let encoding = Encoding { precision, selection, point_transform, restart_rows, codes, ornate };
        assert_same(rows, columns, &encoding, signed, seed);
    }
}

#[test]
fn a_difference_may_be_the_shorter_one_modulo_the_precision() {
    // 52, then 128 by the difference -180 of 8 bits: 52 - 180 = -128, whose lowest 8 bits are 128
    // (as encoders of ultrasound write it); then 130 by +2.
    let wrapped = Encoding { precision: 16, ..PLAIN };
    let mut stream = encode(&[0x8000 - 128 + 52, 0x8000 - 256, 0x8000 - 254], 3, &wrapped);
    let precision = stream.windows(4).position(|bytes| bytes == [0xFF, 0xC3, 0, 11]).expect("a frame") + 4;
    stream[precision] = 8;
    let values = decode(&described(1, 3, 8, false), &stream, SELECTION_1).expect("values");
    assert_eq!(values, [52, 128, 130]);
    // The predictors that halve give other values then, by one reading or another.
    let samples = [0x8000, 0x8000 - 256, 0x8000 - 254, 0x8000 - 250];
    let mut stream = encode(&samples, 2, &Encoding { precision: 16, selection: 7, ..PLAIN });
    stream[precision] = 8;
    let error = decode(&described(2, 2, 8, false), &stream, ANY_SELECTION).expect_err("doubtful");
    assert!(error.to_string().contains("more bits than it says"), "{error}");
}

/// A stream of 6 x 5 samples with a restart marker after every two rows.
fn small() -> Vec<u8> {
    let encoding = Encoding { selection: 4, restart_rows: 2, codes: Codes::ShortFirst, ..PLAIN };
    encode(&samples(30, 12, 7), 5, &encoding)
}

fn refusal(stream: &[u8]) -> String {
    let error = decode(&described(6, 5, 12, false), stream, ANY_SELECTION).expect_err("a refusal");
    assert!(matches!(error, PixelError::Decode(_)), "{error}");
    error.to_string()
}

#[test]
fn every_shortened_stream_is_refused() {
    for encoding in [PLAIN, Encoding { selection: 7, restart_rows: 2, codes: Codes::ShortLast, ..PLAIN }] {
        let whole = encode(&samples(30, 12, 7), 5, &encoding);
        for length in 1..whole.len() {
            refusal(&whole[..length]);
        }
        let start = whole.windows(2).position(|bytes| bytes == [0xFF, 0xDA]).expect("a scan") + 10;
        for cut in start..whole.len() - 2 {
            // The end of image is there, some data before it is not.
            let stream = [&whole[..cut], &[0xFF, 0xD9]].concat();
            assert!(decode(&described(6, 5, 12, false), &stream, ANY_SELECTION).is_err(), "cut at {cut}");
        }
    }
}

#[test]
fn padding_after_the_image_is_let_through_and_anything_else_is_not() {
    for padding in [&[0][..], &[0xFF], &[0; 64], &[0xFF; 7]] {
        let stream = [&small()[..], padding].concat();
        assert!(decode(&described(6, 5, 12, false), &stream, ANY_SELECTION).is_ok(), "{padding:?}");
    }
    // Any one byte, where it makes the length of the fragment even.
    let odd =
        (0..99).map(|seed| encode(&samples(30, 12, seed), 5, &PLAIN)).find(|stream| stream.len() % 2 == 1);
    let odd = [odd.expect("a stream of an odd length"), b" ".to_vec()].concat();
    assert!(decode(&described(6, 5, 12, false), &odd, ANY_SELECTION).is_ok());
    assert!(refusal(&[small(), vec![1, 2, 3]].concat()).contains("followed by something else"));
    assert!(refusal(&[small(), small()].concat()).contains("followed by something else"));
}

#[test]
fn what_is_not_read_is_refused_by_name() {
    let stream = small();
    let find = |marker: u8| stream.windows(2).position(|bytes| bytes == [0xFF, marker]).expect("the marker");
    let changed = |at: usize, byte: u8| {
        let mut stream = stream.clone();
        stream[at] = byte;
        refusal(&stream)
    };
    let (table, frame, restart, scan) = (find(0xC4), find(0xC3), find(0xDD), find(0xDA));
    for (words, message) in [
        ("start of image", changed(1, 0xD9)),
        ("FFC0", changed(frame + 1, 0xC0)),
        ("FFC1", changed(frame + 1, 0xC1)),
        ("FFF7", changed(frame + 1, 0xF7)),
        ("hierarchical", changed(frame + 1, 0xC7)),
        ("hierarchical", changed(frame + 1, 0xDE)),
        ("arithmetic", changed(frame + 1, 0xCB)),
        ("arithmetic", changed(frame + 1, 0xCC)),
        ("samples of 1 bits", changed(frame + 4, 1)),
        ("samples of 17 bits", changed(frame + 4, 17)),
        ("DNL", changed(frame + 6, 0)),
        ("0 x 6", changed(frame + 8, 0)),
        ("5 x 7 samples", changed(frame + 6, 7)),
        ("3 components", changed(frame + 9, 3)),
        ("before its frame header", changed(frame + 1, 0xE5)),
        ("no Huffman table", changed(table + 1, 0xE5)),
        ("no Huffman table", changed(table + 4, 1)),
        ("segment FFC4", changed(table + 5, 3)),
        ("table that is none", changed(table + 4 + 17, 17)),
        ("table that is none", changed(table + 4, 4)),
        ("segment FFC4", changed(table + 3, 30)),
        ("no whole rows", changed(restart + 5, 9)),
        ("segment FFDD", changed(restart + 3, 5)),
        ("scan of 3 components", changed(scan + 4, 3)),
        ("does not have", changed(scan + 5, 8)),
        ("no Huffman table", changed(scan + 6, 0x10)),
        ("selection value 0", changed(scan + 7, 0)),
        ("selection value 8", changed(scan + 7, 8)),
        ("transform of 12 bits", changed(scan + 9, 12)),
        ("FFD0 where FFD1", changed(find(0xD1) + 1, 0xD0)),
        ("FFD1 where FFD0", changed(find(0xD0) + 1, 0xD1)),
        ("FFD8 where", changed(find(0xD0) + 1, 0xD8)),
        ("several scans", changed(stream.len() - 1, 0xDA)),
        ("DNL", changed(stream.len() - 1, 0xDC)),
    ] {
        assert!(message.contains(words), "{words}: {message}");
    }
    // Three codes of one bit.
    let mut crowded = stream.clone();
    crowded[table + 5..table + 8].copy_from_slice(&[3, 0, 0]);
    assert!(refusal(&crowded).contains("table that is none"));
    // Another number of restart markers than rows.
    let lost = find(0xD1);
    assert!(refusal(&[&stream[..lost], &stream[lost + 2..]].concat()).contains("more data"));
    let mut twice = stream.clone();
    twice.splice(frame..frame, stream[frame..frame + 13].iter().copied());
    assert!(refusal(&twice).contains("several frame headers"));
    let mut surplus = stream.clone();
    surplus.splice(lost..lost, [0x12, 0x34]);
    assert!(refusal(&surplus).contains("more data"), "{}", refusal(&surplus));
}

#[test]
fn a_stream_that_claims_four_gigapixels_is_refused_before_it_is_decoded() {
    let mut stream = encode(&samples(30, 12, 7), 5, &PLAIN);
    let frame = stream.windows(2).position(|bytes| bytes == [0xFF, 0xC3]).expect("a frame");
    stream[frame + 5..frame + 9].fill(0xFF);
    assert!(refusal(&stream).contains("65535 x 65535"));
    let claims = described(65535, 65535, 12, false);
    let error = decode(&claims, &stream, ANY_SELECTION).expect_err("4 gigapixels");
    assert!(matches!(error, PixelError::Description(_)), "{error}");
}

#[test]
fn samples_beyond_the_bits_stored_are_refused() {
    let stream = |sample: u16| encode(&[100, 200, sample, 300], 2, &Encoding { precision: 16, ..PLAIN });
    let decode =
        |stored, signed, sample| decode(&described(2, 2, stored, signed), &stream(sample), SELECTION_1);
    assert_eq!(decode(12, false, 4095).expect("values"), [100, 200, 4095, 300]);
    assert_eq!(decode(12, true, 0xFC18).expect("values"), [100, 200, -1000, 300]);
    for (signed, sample) in [(false, 4096), (false, 0xFC18), (true, 0x1000), (true, 0xF7FF)] {
        let error = decode(12, signed, sample).expect_err("beyond");
        assert!(error.to_string().contains("12 bits stored"), "{error}");
    }
}

/// `TRIPLANAR_MUTATIONS` mutated streams, 100 000 where it is not set: values or an error, no panic.
#[test]
fn mutated_streams_never_panic() {
    let count: u32 =
        std::env::var("TRIPLANAR_MUTATIONS").map_or(100_000, |count| count.parse().expect("a count"));
    let mut state = 1_u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as usize
    };
    let (mut read, mut refused) = (0, 0);
    for seed in 0..count {
        let precision = 2 + seed % 15;
        let (rows, columns) = (1 + random() % 12, 1 + random() % 12);
        let encoding = Encoding {
            precision,
            selection: 1 + (seed % 7) as u8,
            point_transform: seed % 3 % precision,
            restart_rows: random() % 4,
            codes: [Codes::Flat, Codes::ShortFirst, Codes::ShortLast][random() % 3],
            ornate: random() % 4 == 0,
        };
        let mut stream = encode(&samples(rows * columns, precision, seed), columns, &encoding);
        for _ in 0..1 + random() % 4 {
            let at = random() % stream.len();
            match random() % 6 {
                0 => stream[at] = random() as u8,
                1 => stream[at] ^= 1 << (random() % 8),
                2 => stream.truncate(at.max(1)),
                3 => stream.insert(at, random() as u8),
                4 => {
                    let end = (at + random() % 6).min(stream.len());
                    stream.drain(at..end.max(at));
                    stream.push(0);
                }
                _ => {
                    let marker = [0xC3, 0xC4, 0xD0, 0xD9, 0xDA, 0xDD, 0x00, 0xFF][random() % 8];
                    stream.splice(at..at, [0xFF, marker]);
                }
            }
        }
        let data_set = described(rows, columns, precision as u16, seed % 2 == 0);
        match decode(&data_set, &stream, ANY_SELECTION) {
            Ok(values) => {
                assert_eq!(values.len(), rows * columns);
                let (low, high) = if seed % 2 == 0 {
                    (-(1 << precision) / 2, (1 << precision) / 2)
                } else {
                    (0, 1 << precision)
                };
                assert!(values.iter().all(|value| (low..high).contains(value)));
                read += 1;
            }
            Err(_) => refused += 1,
        }
    }
    assert!(refused > count / 4 && read > count / 100, "{read} read, {refused} refused: no test of both");
}
