//! What the pictures of a result's slices are drawn from: the part of the volume that shows anything,
//! in 8 bits as it is windowed, and the contours of every slice. Stored with the result, so that a
//! picture never changes and never contradicts its cloud.
//!
//! | bytes | what |
//! |---|---|
//! | `TPIX`, length of the header (u32, little endian) | |
//! | header | JSON with its schema: sizes, window, colours, the length of every block |
//! | bricks | 32³ voxels each (z, y, x; fewer at the ends), deflated; of one that is black there is none |
//! | marks | for each slice of each plane its contour, deflated |
//!
//! A slice of any plane is drawn from the bricks that it cuts and its own marks.

mod header;
mod marks;
mod read;
mod write;

pub use read::{Pictures, PicturesError};
pub(crate) use write::write;

use std::io::{self, Read as _, Write as _};

use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;

/// The first bytes of the file.
const MAGIC: [u8; 4] = *b"TPIX";

/// Voxels along each side of a brick: a slice across 512² cuts 256 of them.
const BRICK: usize = 32;

/// Bytes of a file; what would be larger loses shades of grey until it is not.
pub(crate) const MOST_BYTES: usize = 30_000_000;

/// Bits of grey that can be lost.
const MOST_LOST_BITS: u8 = 6;

/// The same bytes for the same input.
fn deflated(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes)?;
    encoder.finish()
}

/// No more than `most` bytes.
fn inflated(bytes: &[u8], most: usize) -> io::Result<Vec<u8>> {
    let mut out = Vec::new();
    DeflateDecoder::new(bytes).take(most as u64).read_to_end(&mut out)?;
    Ok(out)
}

#[cfg(test)]
mod tests;
