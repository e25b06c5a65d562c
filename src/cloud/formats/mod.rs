//! The formats in which a cloud leaves: one file each, and one row in the table of [`Format`].
//!
//! To add one: a file here with a `Writer`, a variant of [`Format`] and its row in `ALL_ROWS`. API,
//! command line and documentation read that table. A cloud in memory ([`encode`]) and a stored one
//! ([`Conversion`]) go through the same writer.

mod conversion;
mod npy;
mod pcd;
pub mod ply;
mod raw;
mod vertex;

use serde::{Deserialize, Serialize};

use super::{Metadata, PointCloud};
use crate::geometry::Frame;

pub use conversion::{Conversion, ConversionError, Converting};
use vertex::{Layout, Vertex};

/// A file format for clouds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
pub enum Format {
    /// PLY 1.0, binary little endian: x y z float, planes uchar, unique uchar; where known, nx ny nz
    /// float and expected_error_mm float before these two.
    #[default]
    #[serde(rename = "ply_binary", alias = "ply")]
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
    writer: Writer,
}

/// How a format is written.
#[derive(Debug, Clone, Copy)]
struct Writer {
    /// What stands before the first vertex, for so many points.
    header: fn(usize, Layout, &Metadata, Frame) -> Vec<u8>,
    /// Appends a vertex.
    vertex: fn(&Vertex, Frame, &mut Vec<u8>),
    /// Bytes of a vertex where all have the same.
    vertex_bytes: fn(Layout) -> Option<usize>,
}

/// In the order of [`Format::ALL`]; of two with one extension, the first is meant by it.
const ALL_ROWS: [Row; 5] = [
    Row {
        format: Format::PlyBinary,
        name: "ply_binary",
        media_type: "application/x-ply",
        extension: "ply",
        writer: ply::BINARY_WRITER,
    },
    Row {
        format: Format::PlyAscii,
        name: "ply_ascii",
        media_type: "text/x-ply",
        extension: "ply",
        writer: ply::ASCII_WRITER,
    },
    Row {
        format: Format::Pcd,
        name: "pcd",
        media_type: "application/x-pcd",
        extension: "pcd",
        writer: pcd::WRITER,
    },
    Row {
        format: Format::Raw,
        name: "raw",
        media_type: "application/octet-stream",
        extension: "raw",
        writer: raw::WRITER,
    },
    Row {
        format: Format::Npy,
        name: "npy",
        media_type: "application/x-npy",
        extension: "npy",
        writer: npy::WRITER,
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

    /// Another name that is understood wherever a format is asked for: `ply` is the binary one.
    #[must_use]
    pub fn alias(self) -> Option<&'static str> {
        (self == Self::PlyBinary).then_some("ply")
    }

    /// The format of that [`Format::name`] or [`Format::alias`].
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.name() == name || format.alias() == Some(name))
    }

    /// The format that a file with that extension holds, upper or lower case; `ply` is the binary
    /// one.
    #[must_use]
    pub fn from_extension(extension: &str) -> Option<Self> {
        ALL_ROWS.iter().find(|row| row.extension.eq_ignore_ascii_case(extension)).map(|row| row.format)
    }
}

impl utoipa::PartialSchema for Format {
    fn schema() -> utoipa::openapi::RefOr<utoipa::openapi::schema::Schema> {
        let names = Self::ALL.into_iter().flat_map(|format| [Some(format.name()), format.alias()]);
        utoipa::openapi::ObjectBuilder::new()
            .schema_type(utoipa::openapi::schema::Type::String)
            .enum_values(Some(names.flatten()))
            .description(Some("A file format for clouds; `ply` is `ply_binary`."))
            .into()
    }
}

impl utoipa::ToSchema for Format {}

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
    encode_asking(cloud, metadata, format, frame, |_| ())
}

/// The same, telling the number of each vertex before it is written.
pub(crate) fn encode_asking(
    cloud: &PointCloud,
    metadata: &Metadata,
    format: Format,
    frame: Frame,
    before: impl Fn(usize),
) -> Vec<u8> {
    assert!(cloud.is_consistent(), "each list of the cloud has an entry for each point");
    let (writer, layout) = (format.row().writer, Layout::of(cloud));
    let mut out = (writer.header)(cloud.len(), layout, metadata, frame);
    out.reserve(cloud.len() * (writer.vertex_bytes)(layout).unwrap_or_default());
    for i in 0..cloud.len() {
        before(i);
        (writer.vertex)(&Vertex::of(cloud, i), frame, &mut out);
    }
    out
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
            for name in [Some(row.name), format.alias()].into_iter().flatten() {
                assert_eq!(serde_json::from_value::<Format>(name.into()).unwrap(), format);
                assert_eq!(name.parse(), Ok(format));
            }
        }
        assert_eq!(Format::from_extension("PLY"), Some(Format::PlyBinary));
        assert_eq!(Format::from_extension("stl"), None);
    }
}
