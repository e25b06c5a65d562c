//! Reading clouds and meshes of any origin: one file a format.
//!
//! Bounded: every count is held against the bytes that are there before memory is asked for, and
//! nothing panics on bad input.

mod bytes;
mod npy;
mod obj;
mod pcd;
mod ply;
mod raw;
mod stl;
mod words;

use crate::geometry::Frame;

use super::Shape;

/// What a file holds, in the frame it is in.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Contents {
    /// Points and triangles, untouched.
    pub shape: Shape,
    /// The frame that the file itself names (a comment `frame lps` or `frame ras`).
    pub frame: Option<Frame>,
}

/// Why a file can't be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FileError {
    /// No reader for that extension.
    #[error(
        "the extension {0:?} tells no format that is read here; there are .ply, .pcd, .npy, .stl, .obj, .raw and .bin"
    )]
    Extension(String),
    /// The file is not what its extension says, or in a variant that is not read.
    #[error("{0}")]
    Format(String),
    /// The file ends too early or holds too much.
    #[error("{0}: the file is damaged or was not written to its end; write it again")]
    Length(String),
}

impl FileError {
    fn format(message: impl Into<String>) -> Self {
        Self::Format(message.into())
    }

    fn length(message: impl Into<String>) -> Self {
        Self::Length(message.into())
    }
}

type Reader = fn(&[u8]) -> Result<Contents, FileError>;

/// The reader of each extension.
const READERS: [(&str, Reader); 7] = [
    ("ply", ply::read),
    ("pcd", pcd::read),
    ("npy", npy::read),
    ("stl", stl::read),
    ("obj", obj::read),
    ("raw", raw::read),
    ("bin", raw::read),
];

/// Reads a file of that extension (upper or lower case, without the dot).
///
/// # Errors
/// [`FileError`].
pub fn read(bytes: &[u8], extension: &str) -> Result<Contents, FileError> {
    let reader = READERS.iter().find(|(known, _)| known.eq_ignore_ascii_case(extension));
    let (_, reader) = reader.ok_or_else(|| FileError::Extension(extension.to_owned()))?;
    reader(bytes)
}

/// The frame that a comment's text names, if it is one of ours: `frame lps`.
fn frame(comment: &str) -> Option<Frame> {
    let name = comment.trim().strip_prefix("frame ")?.trim();
    [Frame::Lps, Frame::Ras].into_iter().find(|frame| frame.name() == name)
}

/// Triangles that fan out from the first corner of a face; none for fewer than three corners.
fn fan(corners: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    let first = corners.first().copied().unwrap_or(0);
    corners.get(1..).unwrap_or(&[]).windows(2).map(move |pair| [first, pair[0], pair[1]])
}

/// Whether every corner is a point.
fn check_corners(shape: &Shape) -> Result<(), FileError> {
    let is_beyond = |index: &u32| *index as usize >= shape.points.len();
    match shape.triangles.iter().flatten().find(|index| is_beyond(index)) {
        None => Ok(()),
        Some(index) => {
            Err(FileError::length(format!("a face names point {index} of {}", shape.points.len())))
        }
    }
}

/// The columns x, y, z as points, nx, ny, nz (or normal_x, …) as normals, the others as properties.
fn shape_of_columns(columns: Vec<(String, Vec<f64>)>) -> Result<Shape, FileError> {
    let take = |columns: &mut Vec<(String, Vec<f64>)>, name: &str| {
        let at = columns.iter().position(|(known, _)| known == name)?;
        Some(columns.remove(at).1)
    };
    let zip = |x: Vec<f64>, y: Vec<f64>, z: Vec<f64>| {
        x.into_iter().zip(y).zip(z).map(|((x, y), z)| [x, y, z]).collect::<Vec<_>>()
    };
    let mut columns = columns;
    let mut three = |names: [&str; 3]| {
        let is_known = |name: &&str| columns.iter().any(|(known, _)| known == name);
        if !names.iter().all(is_known) {
            return None;
        }
        let [x, y, z] = names.map(|name| take(&mut columns, name));
        Some(zip(x?, y?, z?))
    };
    let points = three(["x", "y", "z"])
        .ok_or_else(|| FileError::format("its points have no x, y and z; export it with coordinates"))?;
    let normals = three(["nx", "ny", "nz"]).or_else(|| three(["normal_x", "normal_y", "normal_z"]));
    #[expect(clippy::cast_possible_truncation, reason = "scalars are for colours")]
    let single = |values: Vec<f64>| values.into_iter().map(|value| value as f32).collect();
    let properties = columns.into_iter().map(|(name, values)| (name, single(values))).collect();
    Ok(Shape { points, normals, properties, triangles: Vec::new() })
}

#[cfg(test)]
mod tests;
