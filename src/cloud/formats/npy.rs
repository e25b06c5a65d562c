//! NumPy's array file, version 1.0: `<f4`, shape (N, 3), C order
//! (NumPy, `numpy.lib.format`).

use super::{Writer, raw};

/// The data begin at a multiple of this.
const ALIGNMENT: usize = 64;

pub(super) const WRITER: Writer = Writer { header: |points, _, _, _| header(points), ..raw::WRITER };

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
