//! Raw coordinates: x y z as little-endian 32-bit floats, point after point, no header.

use super::append_point;
use crate::cloud::{Metadata, PointCloud};
use crate::geometry::Frame;

pub(super) fn encode(cloud: &PointCloud, _: &Metadata, frame: Frame) -> Vec<u8> {
    let mut out = Vec::with_capacity(cloud.len() * 12);
    for &point in &cloud.points {
        append_point(&mut out, frame.from_lps(point));
    }
    out
}
