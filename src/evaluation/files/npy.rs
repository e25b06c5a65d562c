//! NumPy's array file, versions 1 to 3: f4 or f8 of any byte order, shape (N, 3), C or Fortran order
//! (NumPy, `numpy.lib.format`).

use super::bytes::{Endian, Number};
use super::words::shortened;
use super::{Contents, FileError, Shape};

pub(super) fn read(bytes: &[u8]) -> Result<Contents, FileError> {
    let odd = || FileError::format("it is no NumPy array file; write it with numpy.save");
    let short = || FileError::length("the NumPy file ends within its header");
    let rest = bytes.strip_prefix(b"\x93NUMPY").ok_or_else(odd)?;
    let (version, rest) = rest.split_first_chunk::<2>().ok_or_else(short)?;
    let (length, rest) = if version[0] == 1 {
        let (length, rest) = rest.split_first_chunk().ok_or_else(short)?;
        (usize::from(u16::from_le_bytes(*length)), rest)
    } else {
        let (length, rest) = rest.split_first_chunk().ok_or_else(short)?;
        (u32::from_le_bytes(*length) as usize, rest)
    };
    let (header, mut rest) = rest.split_at_checked(length).ok_or_else(short)?;
    let header = String::from_utf8_lossy(header);
    let (number, endian) = kind(&header)?;
    let points = points(&header)?;
    if points.checked_mul(3 * number.size()) != Some(rest.len()) {
        return Err(FileError::length(format!("the NumPy header promises {points} points")));
    }
    let mut values = Vec::with_capacity(points * 3);
    while let Some(value) = number.take(&mut rest, endian) {
        values.push(value);
    }
    let is_fortran = value(&header, "fortran_order").is_some_and(|order| order.starts_with("True"));
    let point = |index: usize| {
        [0, 1, 2].map(|axis| values[if is_fortran { axis * points + index } else { index * 3 + axis }])
    };
    Ok(Contents { shape: Shape::cloud((0..points).map(point).collect()), frame: None })
}

/// What stands behind a key of the header's dictionary.
fn value<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let (_, after) = header.split_once(&format!("'{key}'"))?;
    Some(after.trim_start().strip_prefix(':')?.trim_start())
}

fn kind(header: &str) -> Result<(Number, Endian), FileError> {
    let descr = value(header, "descr").unwrap_or_default();
    match descr.get(..5) {
        Some("'<f4'") => Ok((Number::F32, Endian::Little)),
        Some("'<f8'") => Ok((Number::F64, Endian::Little)),
        Some("'>f4'") => Ok((Number::F32, Endian::Big)),
        Some("'>f8'") => Ok((Number::F64, Endian::Big)),
        _ => Err(FileError::format(format!(
            "a NumPy array of type {} is not read; save array.astype('<f4')",
            shortened(name(descr))
        ))),
    }
}

/// The type's name, if it has one: a record is a list.
fn name(descr: &str) -> &str {
    descr.strip_prefix('\'').and_then(|rest| rest.split_once('\'')).map_or(descr, |(name, _)| name)
}

/// N of the shape (N, 3).
fn points(header: &str) -> Result<usize, FileError> {
    let shape = value(header, "shape").unwrap_or_default();
    let shape = shape.split_once(')').map_or("", |(shape, _)| shape.trim_start_matches('('));
    let sizes: Vec<Option<usize>> =
        shape.split(',').map(str::trim).filter(|n| !n.is_empty()).map(|n| n.parse().ok()).collect();
    match sizes[..] {
        [Some(points), Some(3)] => Ok(points),
        _ => Err(FileError::format(format!(
            "a NumPy array of the shape ({}) is no cloud; save one of the shape (N, 3)",
            shortened(shape)
        ))),
    }
}
