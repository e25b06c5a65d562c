//! PLY 1.0 (Turk 1994), binary little endian and ascii: writing, and reading back what we wrote.
//!
//! The comments carry frame, unit, plane, UIDs, software and parameters (JSON; a long value goes on
//! in the next comment of the same key). A vertex has the
//! properties x, y, z (float); where the cloud has them nx, ny, nz (float, outward unit normal in the
//! file's frame) and `expected_error_mm` (float); `planes` (uchar, bits: 1 axial, 2 sagittal, 4
//! coronal) and `unique` (uchar, 0 or 1).

mod decode;

use std::fmt::Write as _;

use super::{Field, Layout, append_packed, flags, floats};
use crate::cloud::{Metadata, PointCloud};
use crate::geometry::Frame;

pub use decode::{PlyError, decode};

const BINARY: &str = "binary_little_endian";
const ASCII: &str = "ascii";

/// Type and name of a property, as they stand in the header.
fn property(field: Field) -> String {
    format!("{} {}", if field.size == 4 { "float" } else { "uchar" }, field.ply)
}

pub(super) fn encode_binary(cloud: &PointCloud, metadata: &Metadata, frame: Frame) -> Vec<u8> {
    let mut out = header(BINARY, cloud, metadata, frame).into_bytes();
    append_packed(&mut out, cloud, frame);
    out
}

pub(super) fn encode_ascii(cloud: &PointCloud, metadata: &Metadata, frame: Frame) -> Vec<u8> {
    let mut out = header(ASCII, cloud, metadata, frame);
    for i in 0..cloud.len() {
        for value in floats(cloud, i, frame) {
            // Display prints the shortest text that reads back to the same float.
            write!(out, "{value} ").expect("writing to a string");
        }
        let [planes, unique] = flags(cloud, i);
        writeln!(out, "{planes} {unique}").expect("writing to a string");
    }
    out.into_bytes()
}

fn header(encoding: &str, cloud: &PointCloud, metadata: &Metadata, frame: Frame) -> String {
    let mut out = format!("ply\nformat {encoding} 1.0\n");
    for (key, value) in metadata.lines(frame) {
        writeln!(out, "comment {key} {value}").expect("writing to a string");
    }
    writeln!(out, "element vertex {}", cloud.len()).expect("writing to a string");
    for field in Layout::of(cloud).fields() {
        writeln!(out, "property {}", property(field)).expect("writing to a string");
    }
    out.push_str("end_header\n");
    out
}
