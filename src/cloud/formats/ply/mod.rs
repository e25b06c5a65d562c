//! PLY 1.0 (Turk 1994), binary little endian and ascii: writing, and reading back what we wrote.
//!
//! The comments carry frame, unit, plane, UIDs, software and parameters (JSON; a long value goes on
//! in the next comment of the same key). A vertex has the
//! properties x, y, z (float); where the cloud has them nx, ny, nz (float, outward unit normal in the
//! file's frame) and `expected_error_mm` (float); `planes` (uchar, bits: 1 axial, 2 sagittal, 4
//! coronal) and `unique` (uchar, 0 or 1).

mod decode;

mod stored;

use std::io::Write as _;

use super::Writer;
use super::vertex::{Field, Layout, Vertex};
use crate::cloud::Metadata;
use crate::geometry::Frame;

pub use decode::{PlyError, decode};
pub(super) use stored::StoredCloud;

const BINARY: &str = "binary_little_endian";
const ASCII: &str = "ascii";

/// Type and name of a property, as they stand in the header.
fn property(field: Field) -> String {
    format!("{} {}", if field.size == 4 { "float" } else { "uchar" }, field.ply)
}

pub(super) const BINARY_WRITER: Writer = Writer {
    header: |points, layout, metadata, frame| header(BINARY, points, layout, metadata, frame),
    vertex: |vertex, frame, out| Vertex::append_packed(vertex, out, frame),
    vertex_bytes: |layout| Some(layout.size()),
};

pub(super) const ASCII_WRITER: Writer = Writer {
    header: |points, layout, metadata, frame| header(ASCII, points, layout, metadata, frame),
    vertex: |vertex, frame, out| {
        // Display prints the shortest text that reads back to the same float.
        for value in vertex.floats(frame) {
            write!(out, "{value} ").expect("writing to a Vec");
        }
        writeln!(out, "{} {}", vertex.planes, vertex.unique).expect("writing to a Vec");
    },
    vertex_bytes: |_| None,
};

/// Whether a binary file that [`super::encode`] wrote holds no vertex, without reading it all: nothing
/// follows the header. (A vertex ends with its flag `unique`, 0 or 1, never with a line break.)
#[must_use]
pub fn is_empty(binary: &[u8]) -> bool {
    binary.ends_with(b"\nend_header\n")
}

fn header(encoding: &str, points: usize, layout: Layout, metadata: &Metadata, frame: Frame) -> Vec<u8> {
    let mut out = format!("ply\nformat {encoding} 1.0\n").into_bytes();
    for (key, value) in metadata.lines(frame) {
        writeln!(out, "comment {key} {value}").expect("writing to a Vec");
    }
    writeln!(out, "element vertex {points}").expect("writing to a Vec");
    for field in layout.fields() {
        writeln!(out, "property {}", property(field)).expect("writing to a Vec");
    }
    out.extend(b"end_header\n");
    out
}
