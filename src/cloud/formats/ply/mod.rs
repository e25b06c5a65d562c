//! PLY 1.0 (Turk 1994), binary little endian and ascii: writing, and reading back what we wrote.
//!
//! The comments carry frame, unit, plane, UIDs, software and parameters (JSON; a long value goes on
//! in the next comment of the same key). A vertex has the
//! properties x, y, z (float), `planes` (uchar, bits: 1 axial, 2 sagittal, 4 coronal) and `unique`
//! (uchar, 0 or 1).

mod decode;

use std::fmt::Write as _;

use super::{append_packed, vertices};
use crate::cloud::{Metadata, PointCloud};
use crate::geometry::Frame;

pub use decode::{PlyError, decode};

const BINARY: &str = "binary_little_endian";
const ASCII: &str = "ascii";
/// Type and name of each property, in their order.
const PROPERTIES: [(&str, &str); 5] =
    [("float", "x"), ("float", "y"), ("float", "z"), ("uchar", "planes"), ("uchar", "unique")];

pub(super) fn encode_binary(cloud: &PointCloud, metadata: &Metadata, frame: Frame) -> Vec<u8> {
    let mut out = header(BINARY, cloud.len(), metadata, frame).into_bytes();
    append_packed(&mut out, cloud, frame);
    out
}

pub(super) fn encode_ascii(cloud: &PointCloud, metadata: &Metadata, frame: Frame) -> Vec<u8> {
    let mut out = header(ASCII, cloud.len(), metadata, frame);
    for ([x, y, z], [planes, unique]) in vertices(cloud, frame) {
        // Display prints the shortest text that reads back to the same float.
        writeln!(out, "{x} {y} {z} {planes} {unique}").expect("writing to a string");
    }
    out.into_bytes()
}

fn header(encoding: &str, points: usize, metadata: &Metadata, frame: Frame) -> String {
    let mut out = format!("ply\nformat {encoding} 1.0\n");
    for (key, value) in metadata.lines(frame) {
        writeln!(out, "comment {key} {value}").expect("writing to a string");
    }
    writeln!(out, "element vertex {points}").expect("writing to a string");
    for (kind, name) in PROPERTIES {
        writeln!(out, "property {kind} {name}").expect("writing to a string");
    }
    out.push_str("end_header\n");
    out
}
