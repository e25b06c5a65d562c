//! PLY 1.0 (Turk 1994): ascii and both binary encodings, any elements and properties in any order.
//!
//! Scalars of `vertex` become points, normals and properties; the list `vertex_indices` (or
//! `vertex_index`) of `face` becomes triangles. Everything else is skipped.

mod body;
mod header;

use super::{Contents, FileError, check_corners, shape_of_columns};

pub(super) fn read(bytes: &[u8]) -> Result<Contents, FileError> {
    let (header, rest) = header::Header::read(bytes)?;
    let body = body::read(&header, rest)?;
    let mut shape = shape_of_columns(body.columns)?;
    shape.triangles = body.triangles;
    check_corners(&shape)?;
    Ok(Contents { shape, frame: header.frame })
}
