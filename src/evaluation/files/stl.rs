//! STL, binary and ascii: every triangle with corners of its own.

use super::bytes::{Endian, Number, take_line};
use super::words::shortened;
use super::{Contents, FileError, Shape};
use crate::geometry::Vec3;

/// Bytes before the number of triangles.
const HEADER: usize = 80;
/// A normal and three corners of three floats each, and two bytes.
const TRIANGLE: usize = 50;

pub(super) fn read(bytes: &[u8]) -> Result<Contents, FileError> {
    // Binary files may begin with `solid`, too: their length decides.
    let counted = bytes.get(HEADER..).and_then(|rest| rest.split_first_chunk());
    if let Some((count, rest)) = counted
        && (u32::from_le_bytes(*count) as usize).checked_mul(TRIANGLE) == Some(rest.len())
    {
        return Ok(contents(binary(rest)));
    }
    if bytes.trim_ascii_start().starts_with(b"solid") {
        return text(bytes).map(contents);
    }
    Err(FileError::length("it is neither an STL text nor as long as the STL header promises"))
}

fn contents(points: Vec<Vec3>) -> Contents {
    let count = u32::try_from(points.len() / 3).unwrap_or(0);
    let triangles = (0..count).map(|n| [0, 1, 2].map(|corner| n.saturating_mul(3).saturating_add(corner)));
    Contents { shape: Shape { triangles: triangles.collect(), ..Shape::cloud(points) }, frame: None }
}

fn binary(rest: &[u8]) -> Vec<Vec3> {
    let corner = |rest: &mut &[u8]| {
        let mut next = || Number::F32.take(rest, Endian::Little).unwrap_or(f64::NAN);
        [next(), next(), next()]
    };
    let triangles = rest.as_chunks::<TRIANGLE>().0.iter();
    triangles
        .flat_map(|triangle| {
            let mut rest = &triangle[12..];
            [corner(&mut rest), corner(&mut rest), corner(&mut rest)]
        })
        .collect()
}

fn text(bytes: &[u8]) -> Result<Vec<Vec3>, FileError> {
    let mut rest = bytes;
    let mut points = Vec::new();
    while let Some(line) = take_line(&mut rest) {
        if let Some(numbers) = line.trim_start().strip_prefix("vertex") {
            let mut words = numbers.split_ascii_whitespace().map(|word| word.parse::<f64>().ok());
            let mut next = || words.next().flatten();
            let corner = next().zip(next()).zip(next()).map(|((x, y), z)| [x, y, z]);
            points.push(corner.ok_or_else(|| {
                FileError::format(format!("the STL file has the line {:?}", shortened(&line)))
            })?);
        }
    }
    if points.len() % 3 != 0 {
        return Err(FileError::length("the STL file ends within a triangle"));
    }
    Ok(points)
}
