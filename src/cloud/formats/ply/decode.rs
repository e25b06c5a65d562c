//! Reading back our own PLY.

use super::{ASCII, BINARY, property};
use crate::cloud::formats::vertex::Layout;
use crate::cloud::metadata::{TRIPLANAR, key};
use crate::cloud::{Metadata, PointCloud};
use crate::geometry::{Frame, Plane, PlaneSet};

/// Why bytes are not a PLY that [`super::super::encode`] wrote.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PlyError {
    /// The header is not one of ours.
    #[error("not a PLY file of triplanar: {0}")]
    Header(String),
    /// Fewer or more bytes than the header promises.
    #[error("the PLY file does not hold the {promised} vertices that its header promises")]
    Length {
        /// The header's number of vertices.
        promised: usize,
    },
    /// A line of an ascii file is no vertex.
    #[error("vertex {0} of the PLY file can't be read")]
    Vertex(usize),
}

/// The cloud in LPS mm (whatever frame the file is in) and what its comments say. Takes both
/// encodings that [`super::super::encode`] writes.
///
/// # Errors
/// [`PlyError`] for anything else.
pub fn decode(bytes: &[u8]) -> Result<(PointCloud, Metadata), PlyError> {
    let mut header = Header::default();
    let mut rest = bytes;
    let mut first = true;
    loop {
        let line = take_line(&mut rest).ok_or_else(|| PlyError::Header("its header does not end".into()))?;
        match (first, line) {
            (true, "ply") => first = false,
            (true, _) => return Err(PlyError::Header("it does not begin with `ply`".into())),
            (false, "end_header") => break,
            (false, line) => header.line(line)?,
        }
    }
    let (encoding, layout, promised, frame, metadata) = header.finish()?;
    let mut cloud = match encoding {
        Encoding::Binary => packed(rest, promised, layout)?,
        Encoding::Ascii => text(rest, promised, layout)?,
    };
    for vector in cloud.points.iter_mut().chain(&mut cloud.normals) {
        // Negating two axes is its own inverse.
        *vector = frame.from_lps(*vector);
    }
    Ok((cloud, metadata))
}

/// One line without its end, as text.
fn take_line<'a>(rest: &mut &'a [u8]) -> Option<&'a str> {
    let end = rest.iter().position(|&byte| byte == b'\n')?;
    let (line, after) = rest.split_at(end);
    *rest = after.get(1..)?;
    std::str::from_utf8(line).ok()
}

/// How the vertices are written.
#[derive(Clone, Copy)]
pub(super) enum Encoding {
    Binary,
    Ascii,
}

/// The lines of a header.
#[derive(Default)]
pub(super) struct Header {
    encoding: Option<Encoding>,
    vertices: Option<usize>,
    properties: Vec<String>,
    comments: Vec<(String, String)>,
}

impl Header {
    /// Takes one line between the first and `end_header`.
    pub(super) fn line(&mut self, line: &str) -> Result<(), PlyError> {
        let unknown = || PlyError::Header(format!("unknown line {line:?}"));
        let (word, value) = line.split_once(' ').ok_or_else(unknown)?;
        match word {
            "format" => self.encoding = Some(encoding(value).ok_or_else(unknown)?),
            "comment" => {
                let (key, value) = value.split_once(' ').unwrap_or((value, ""));
                self.comments.push((key.to_owned(), value.to_owned()));
            }
            "element" => {
                let count = value.strip_prefix("vertex ").and_then(|n| n.parse().ok());
                self.vertices = Some(count.ok_or_else(unknown)?);
            }
            "property" => self.properties.push(value.to_owned()),
            _ => return Err(unknown()),
        }
        Ok(())
    }

    /// Encoding, layout, vertices, frame and comments.
    pub(super) fn finish(self) -> Result<(Encoding, Layout, usize, Frame, Metadata), PlyError> {
        let lacks = |what: &str| PlyError::Header(format!("its header lacks {what}"));
        let encoding = self.encoding.ok_or_else(|| lacks("`format`"))?;
        let vertices = self.vertices.ok_or_else(|| lacks("`element vertex`"))?;
        let layout = Layout::ALL
            .into_iter()
            .find(|layout| layout.fields().map(property).eq(self.properties.iter().cloned()))
            .ok_or_else(|| {
                PlyError::Header(format!("its properties are not ours: {}", self.properties.join(", ")))
            })?;
        let comment =
            |key: &str| self.comments.iter().find(|(name, _)| name == key).map(|(_, value)| value.as_str());
        let joined = |key: &str| {
            let parts = self.comments.iter().filter(|(name, _)| name == key);
            parts.map(|(_, value)| value.as_str()).collect::<String>()
        };
        let frame = [Frame::Lps, Frame::Ras].into_iter().find(|f| comment(key::FRAME) == Some(f.name()));
        let plane = match comment(key::PLANE) {
            Some(TRIPLANAR) => None,
            name => Some(
                Plane::ALL
                    .into_iter()
                    .find(|plane| name == Some(plane.name()))
                    .ok_or_else(|| lacks("`plane`"))?,
            ),
        };
        let uid = |key| comment(key).and_then(|text| text.parse().ok());
        let metadata = Metadata {
            series_instance_uid: uid(key::SERIES).ok_or_else(|| lacks("`series_instance_uid`"))?,
            frame_of_reference_uid: comment(key::FRAME_OF_REFERENCE).and_then(|text| text.parse().ok()),
            plane,
            max_error_mm: comment(key::MAX_ERROR).and_then(|text| text.parse().ok()),
            software: joined(key::SOFTWARE),
            parameters_json: joined(key::PARAMETERS),
        };
        Ok((encoding, layout, vertices, frame.ok_or_else(|| lacks("`frame`"))?, metadata))
    }
}

fn encoding(format: &str) -> Option<Encoding> {
    match format.strip_suffix(" 1.0")? {
        BINARY => Some(Encoding::Binary),
        ASCII => Some(Encoding::Ascii),
        _ => None,
    }
}

fn packed(bytes: &[u8], promised: usize, layout: Layout) -> Result<PointCloud, PlyError> {
    if promised.checked_mul(layout.size()) != Some(bytes.len()) {
        return Err(PlyError::Length { promised });
    }
    let mut cloud = PointCloud::default();
    for vertex in bytes.chunks_exact(layout.size()) {
        let (floats, flags) = vertex.as_chunks::<4>();
        let floats = floats.iter().map(|bytes| f32::from_le_bytes(*bytes));
        let [planes, unique] = *flags else { return Err(PlyError::Length { promised }) };
        push(&mut cloud, layout, floats, planes, unique).ok_or(PlyError::Length { promised })?;
    }
    Ok(cloud)
}

fn text(bytes: &[u8], promised: usize, layout: Layout) -> Result<PointCloud, PlyError> {
    let text = std::str::from_utf8(bytes).map_err(|_| PlyError::Vertex(0))?;
    let mut cloud = PointCloud::default();
    for (index, line) in text.lines().enumerate() {
        push_line(&mut cloud, layout, line).ok_or(PlyError::Vertex(index))?;
    }
    if cloud.len() == promised { Ok(cloud) } else { Err(PlyError::Length { promised }) }
}

fn push_line(cloud: &mut PointCloud, layout: Layout, line: &str) -> Option<()> {
    let words: Vec<&str> = line.split_ascii_whitespace().collect();
    let (floats, [planes, unique]) = words.split_last_chunk()?;
    let floats = floats.iter().map(|word| word.parse()).collect::<Result<Vec<f32>, _>>().ok()?;
    push(cloud, layout, floats.into_iter(), planes.parse().ok()?, unique.parse().ok()?)
}

/// Appends a vertex; `None` if there are too few or too many floats.
fn push(
    cloud: &mut PointCloud,
    layout: Layout,
    mut floats: impl Iterator<Item = f32>,
    planes: u8,
    unique: u8,
) -> Option<()> {
    let mut vector = || Some([floats.next()?, floats.next()?, floats.next()?]);
    cloud.points.push(vector()?);
    if layout.normals {
        cloud.normals.push(vector()?);
    }
    if layout.errors {
        cloud.errors.push(floats.next()?);
    }
    cloud.planes.push(PlaneSet::from_bits(planes));
    cloud.unique.push(unique != 0);
    floats.next().is_none().then_some(())
}
