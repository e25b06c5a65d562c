//! PCD 0.7, the Point Cloud Library's file, binary.

use std::fmt::Write as _;

use super::Writer;
use super::vertex::{Field, Layout, Vertex};
use crate::cloud::Metadata;
use crate::geometry::Frame;

pub(super) const WRITER: Writer = Writer {
    header,
    vertex: |vertex, frame, out| Vertex::append_packed(vertex, out, frame),
    vertex_bytes: |layout| Some(layout.size()),
};

fn header(points: usize, layout: Layout, metadata: &Metadata, frame: Frame) -> Vec<u8> {
    let mut header = String::from("# .PCD v0.7 - Point Cloud Data file format\n");
    for (key, value) in metadata.lines(frame) {
        writeln!(header, "# {key} {value}").expect("writing to a string");
    }
    let fields: Vec<_> = layout.fields().collect();
    let column = |text: fn(&Field) -> String| fields.iter().map(text).collect::<Vec<_>>().join(" ");
    let names = column(|field| field.pcd.to_owned());
    let sizes = column(|field| field.size.to_string());
    let types = column(|field| if field.size == 4 { "F" } else { "U" }.to_owned());
    let counts = column(|_| "1".to_owned());
    write!(
        header,
        "VERSION 0.7\n\
         FIELDS {names}\n\
         SIZE {sizes}\n\
         TYPE {types}\n\
         COUNT {counts}\n\
         WIDTH {points}\n\
         HEIGHT 1\n\
         VIEWPOINT 0 0 0 1 0 0 0\n\
         POINTS {points}\n\
         DATA binary\n"
    )
    .expect("writing to a string");
    header.into_bytes()
}
