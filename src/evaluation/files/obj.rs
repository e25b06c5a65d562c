//! Wavefront OBJ: `v` and `f`; groups, textures, normals and materials are skipped.

use super::bytes::take_line;
use super::words::shortened;
use super::{Contents, FileError, Shape, check_corners, fan, frame};
use crate::geometry::Vec3;

pub(super) fn read(bytes: &[u8]) -> Result<Contents, FileError> {
    let mut rest = bytes;
    let mut shape = Shape::default();
    let mut stated = None;
    while let Some(line) = take_line(&mut rest) {
        let odd = || FileError::format(format!("the OBJ file has the line {:?}", shortened(&line)));
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => shape.points.push(vertex(words).ok_or_else(odd)?),
            Some("f") => {
                let corners: Option<Vec<u32>> = words.map(|word| corner(word, shape.points.len())).collect();
                shape.triangles.extend(fan(&corners.ok_or_else(odd)?));
            }
            Some("#") => stated = stated.or(line.trim().strip_prefix('#').and_then(frame)),
            _ => {}
        }
    }
    if shape.points.is_empty() {
        return Err(FileError::format("the OBJ file has no line `v x y z`"));
    }
    check_corners(&shape)?;
    Ok(Contents { shape, frame: stated })
}

fn vertex<'a>(words: impl Iterator<Item = &'a str>) -> Option<Vec3> {
    let mut numbers = words.map(|word| word.parse().ok());
    Some([numbers.next()??, numbers.next()??, numbers.next()??])
}

/// `a`, `a/b` or `a/b/c`: from 1, or back from the last point if negative.
fn corner(word: &str, points: usize) -> Option<u32> {
    let number: i64 = word.split('/').next()?.parse().ok()?;
    let index = match number {
        1.. => number - 1,
        0 => return None,
        _ => i64::try_from(points).ok()?.checked_add(number)?,
    };
    u32::try_from(index).ok()
}
