//! Raw coordinates: x y z as little-endian 32-bit floats, point after point.

use super::{Contents, FileError, Shape};

pub(super) fn read(bytes: &[u8]) -> Result<Contents, FileError> {
    let (points, rest) = bytes.as_chunks::<12>();
    if !rest.is_empty() {
        return Err(FileError::length(format!(
            "{} bytes are no whole number of points of 12 bytes",
            bytes.len()
        )));
    }
    let coordinate = |bytes: &[u8; 4]| f64::from(f32::from_le_bytes(*bytes));
    let point = |point: &[u8; 12]| {
        let coordinates = point.as_chunks::<4>().0;
        [0, 1, 2].map(|axis| coordinate(&coordinates[axis]))
    };
    Ok(Contents { shape: Shape::cloud(points.iter().map(point).collect()), frame: None })
}
