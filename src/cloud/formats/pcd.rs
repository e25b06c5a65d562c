//! PCD 0.7, the Point Cloud Library's file, binary.

use std::fmt::Write as _;

use super::append_packed;
use crate::cloud::{Metadata, PointCloud};
use crate::geometry::Frame;

pub(super) fn encode(cloud: &PointCloud, metadata: &Metadata, frame: Frame) -> Vec<u8> {
    let mut header = String::from("# .PCD v0.7 - Point Cloud Data file format\n");
    for (key, value) in metadata.lines(frame) {
        writeln!(header, "# {key} {value}").expect("writing to a string");
    }
    let points = cloud.len();
    write!(
        header,
        "VERSION 0.7\n\
         FIELDS x y z planes unique\n\
         SIZE 4 4 4 1 1\n\
         TYPE F F F U U\n\
         COUNT 1 1 1 1 1\n\
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
