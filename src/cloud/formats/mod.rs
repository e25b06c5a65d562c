//! The formats in which a cloud leaves: one file each, and one row in the table of [`Format`].
//!
//! To add one: a file here with `encode(&PointCloud, &Metadata, Frame) -> Vec<u8>`, a variant of
//! [`Format`] and its row in `ALL_ROWS`. API, command line and documentation read that table.

mod npy;
mod pcd;
pub mod ply;
mod raw;

use serde::{Deserialize, Serialize};

use super::{Metadata, PointCloud};
use crate::geometry::Frame;

/// A file format for clouds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize, utoipa::ToSchema)]
pub enum Format {
    /// PLY 1.0, binary little endian: x y z float, planes uchar, unique uchar; where known, nx ny nz
    /// float and expected_error_mm float before these two.
    #[default]
    #[serde(rename = "ply_binary")]
    PlyBinary,
    /// PLY 1.0, text; the floats read back to the same bits.
    #[serde(rename = "ply_ascii")]
    PlyAscii,
    /// PCD 0.7, binary: x y z F4, planes U1, unique U1; where known, normal_x normal_y normal_z F4 and
    /// expected_error_mm F4 before these two.
    #[serde(rename = "pcd")]
    Pcd,
    /// x y z as little-endian 32-bit floats, nothing else.
    #[serde(rename = "raw")]
    Raw,
    /// NumPy 1.0, `<f4`, shape (N, 3).
    #[serde(rename = "npy")]
    Npy,
}

/// What is known of a format.
struct Row {
    format: Format,
    name: &'static str,
    media_type: &'static str,
    extension: &'static str,
    encode: fn(&PointCloud, &Metadata, Frame) -> Vec<u8>,
}

/// In the order of [`Format::ALL`]; of two with one extension, the first is meant by it.
const ALL_ROWS: [Row; 5] = [
    Row {
        format: Format::PlyBinary,
        name: "ply_binary",
        media_type: "application/x-ply",
        extension: "ply",
        encode: ply::encode_binary,
    },
    Row {
        format: Format::PlyAscii,
        name: "ply_ascii",
        media_type: "text/x-ply",
        extension: "ply",
        encode: ply::encode_ascii,
    },
    Row {
        format: Format::Pcd,
        name: "pcd",
        media_type: "application/x-pcd",
        extension: "pcd",
        encode: pcd::encode,
    },
    Row {
        format: Format::Raw,
        name: "raw",
        media_type: "application/octet-stream",
        extension: "raw",
        encode: raw::encode,
    },
    Row {
        format: Format::Npy,
        name: "npy",
        media_type: "application/x-npy",
        extension: "npy",
        encode: npy::encode,
    },
];

/// A name that is no format's.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("no cloud format is called {0:?}; there are ply_binary, ply_ascii, pcd, raw and npy")]
pub struct UnknownFormat(pub String);

impl Format {
    /// All formats, the default first.
    pub const ALL: [Self; 5] = [Self::PlyBinary, Self::PlyAscii, Self::Pcd, Self::Raw, Self::Npy];

    fn row(self) -> &'static Row {
        &ALL_ROWS[self as usize]
    }

    /// The one name in API and command line: `ply_binary`, `ply_ascii`, `pcd`, `raw` or `npy`.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// The media type for `Accept` and `Content-Type`. None of these is registered with IANA.
    #[must_use]
    pub fn media_type(self) -> &'static str {
        self.row().media_type
    }

    /// The file name's extension, without the dot.
    #[must_use]
    pub fn extension(self) -> &'static str {
        self.row().extension
    }

    /// The format of that [`Format::name`].
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        ALL_ROWS.iter().find(|row| row.name == name).map(|row| row.format)
    }

    /// The format that a file with that extension holds, upper or lower case; `ply` is the binary
    /// one.
    #[must_use]
    pub fn from_extension(extension: &str) -> Option<Self> {
        ALL_ROWS.iter().find(|row| row.extension.eq_ignore_ascii_case(extension)).map(|row| row.format)
    }
}

impl std::str::FromStr for Format {
    type Err = UnknownFormat;
    fn from_str(name: &str) -> Result<Self, UnknownFormat> {
        Self::from_name(name).ok_or_else(|| UnknownFormat(name.to_owned()))
    }
}

/// The cloud (LPS mm) as a file of that format in that frame. The same arguments give the same
/// bytes. An empty cloud gives a valid file of 0 points.
///
/// # Panics
/// If the cloud's lists differ in length (a mistake of the caller).
#[must_use]
pub fn encode(cloud: &PointCloud, metadata: &Metadata, format: Format, frame: Frame) -> Vec<u8> {
    assert!(cloud.is_consistent(), "each list of the cloud has an entry for each point");
    (format.row().encode)(cloud, metadata, frame)
}

/// What a vertex carries in the formats that can say so.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Field {
    /// Its property in PLY.
    ply: &'static str,
    /// Its field in PCD, where the Point Cloud Library has a name of its own.
    pcd: &'static str,
    /// Bytes: 4 for a float, 1 for an unsigned one.
    size: usize,
}

impl Field {
    const fn float(ply: &'static str, pcd: &'static str) -> Self {
        Self { ply, pcd, size: 4 }
    }

    const fn byte(name: &'static str) -> Self {
        Self { ply: name, pcd: name, size: 1 }
    }
}

const POINT: [Field; 3] = [Field::float("x", "x"), Field::float("y", "y"), Field::float("z", "z")];
const NORMAL: [Field; 3] =
    [Field::float("nx", "normal_x"), Field::float("ny", "normal_y"), Field::float("nz", "normal_z")];
const ERROR: [Field; 1] = [Field::float("expected_error_mm", "expected_error_mm")];
const FLAGS: [Field; 2] = [Field::byte("planes"), Field::byte("unique")];

/// Which of the fields that not every cloud has are there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Layout {
    normals: bool,
    errors: bool,
}

impl Layout {
    /// All layouts, the barest first.
    const ALL: [Self; 4] = [
        Self { normals: false, errors: false },
        Self { normals: true, errors: false },
        Self { normals: false, errors: true },
        Self { normals: true, errors: true },
    ];

    fn of(cloud: &PointCloud) -> Self {
        Self { normals: !cloud.normals.is_empty(), errors: !cloud.errors.is_empty() }
    }

    /// The fields of a vertex in their order: floats first, bytes last.
    fn fields(self) -> impl Iterator<Item = Field> {
        let normal = NORMAL.into_iter().filter(move |_| self.normals);
        let error = ERROR.into_iter().filter(move |_| self.errors);
        POINT.into_iter().chain(normal).chain(error).chain(FLAGS)
    }

    /// Bytes of a vertex.
    fn size(self) -> usize {
        self.fields().map(|field| field.size).sum()
    }
}

/// The floats of the vertex `i` in that frame: point, normal and error, those that there are.
fn floats(cloud: &PointCloud, i: usize, frame: Frame) -> impl Iterator<Item = f32> {
    // A direction turns with the axes as a point does.
    let normal = cloud.normals.get(i).map(|&normal| frame.from_lps(normal));
    let error = cloud.errors.get(i).copied();
    frame.from_lps(cloud.points[i]).into_iter().chain(normal.into_iter().flatten()).chain(error)
}

/// The bytes that end the vertex `i`.
fn flags(cloud: &PointCloud, i: usize) -> [u8; 2] {
    [cloud.planes[i].bits(), u8::from(cloud.unique[i])]
}

/// Appends each vertex as little-endian floats and its two flags.
fn append_packed(out: &mut Vec<u8>, cloud: &PointCloud, frame: Frame) {
    out.reserve(cloud.len() * Layout::of(cloud).size());
    for i in 0..cloud.len() {
        for value in floats(cloud, i, frame) {
            out.extend(value.to_le_bytes());
        }
        out.extend(flags(cloud, i));
    }
}

fn append_point(out: &mut Vec<u8>, point: [f32; 3]) {
    for coordinate in point {
        out.extend(coordinate.to_le_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_in_the_order_of_the_variants_and_its_names_are_found() {
        for (row, format) in ALL_ROWS.iter().zip(Format::ALL) {
            assert_eq!(row.format, format);
            assert_eq!(Format::from_name(row.name), Some(format));
            assert_eq!(serde_json::to_value(format).unwrap(), row.name);
        }
        assert_eq!(Format::from_extension("PLY"), Some(Format::PlyBinary));
        assert_eq!(Format::from_extension("stl"), None);
    }
}
