//! NumPy's array file, version 1.0: `<f4`, shape (N, 3), C order
//! (NumPy, `numpy.lib.format`).

use super::raw;
use crate::cloud::{Metadata, PointCloud};
use crate::geometry::Frame;

/// The data begin at a multiple of this.
const ALIGNMENT: usize = 64;

pub(super) fn encode(cloud: &PointCloud, metadata: &Metadata, frame: Frame) -> Vec<u8> {
    let mut out = header(cloud.len());
    out.extend(raw::encode(cloud, metadata, frame));
    out
}

/// Magic, version, length of the dictionary, and the dictionary padded with blanks and ended by a
/// line break.
fn header(points: usize) -> Vec<u8> {
    let mut dictionary = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({points}, 3), }}");
    const PREFIX: usize = 10;
    let unpadded = PREFIX + dictionary.len() + 1;
    dictionary.extend(std::iter::repeat_n(' ', unpadded.next_multiple_of(ALIGNMENT) - unpadded));
    dictionary.push('\n');
    let length = u16::try_from(dictionary.len()).expect("the dictionary is shorter than 200 characters");
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend(length.to_le_bytes());
    out.extend(dictionary.as_bytes());
    out
}
