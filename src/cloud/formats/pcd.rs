//! PCD 0.7, the Point Cloud Library's file, binary.

use std::fmt::Write as _;

use super::{Field, Layout, append_packed};
use crate::cloud::{Metadata, PointCloud};
use crate::geometry::Frame;

pub(super) fn encode(cloud: &PointCloud, metadata: &Metadata, frame: Frame) -> Vec<u8> {
    let mut header = String::from("# .PCD v0.7 - Point Cloud Data file format\n");
    for (key, value) in metadata.lines(frame) {
        writeln!(header, "# {key} {value}").expect("writing to a string");
    }
    let points = cloud.len();
    let fields: Vec<_> = Layout::of(cloud).fields().collect();
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
    let mut out = header.into_bytes();
    append_packed(&mut out, cloud, frame);
    out
}
