//! A binary PLY of ours, vertex by vertex.

use std::io::{self, BufRead};

use super::decode::{Encoding, Header, PlyError};
use crate::cloud::Metadata;
use crate::cloud::formats::vertex::{Layout, Vertex};
use crate::geometry::Frame;

/// The longest line of a header that is read.
const MAX_LINE: u64 = 4096;

/// A cloud that is read as it is needed.
#[derive(Debug)]
pub(in crate::cloud::formats) struct StoredCloud<R> {
    reader: R,
    frame: Frame,
    /// The fields of its vertices.
    pub(in crate::cloud::formats) layout: Layout,
    /// What its comments say.
    pub(in crate::cloud::formats) metadata: Metadata,
    /// Its number of vertices.
    pub(in crate::cloud::formats) vertices: usize,
    /// Vertices read.
    read: usize,
}

impl<R: BufRead> StoredCloud<R> {
    /// Reads the header. What is no binary PLY of ours is a [`PlyError`] within the error.
    pub(in crate::cloud::formats) fn open(mut reader: R) -> io::Result<Self> {
        let mut header = Header::default();
        let mut first = true;
        loop {
            let line = line(&mut reader)?;
            match (first, line.as_str()) {
                (true, "ply") => first = false,
                (true, _) => return Err(invalid(PlyError::Header("it does not begin with `ply`".into()))),
                (false, "end_header") => break,
                (false, line) => header.line(line).map_err(invalid)?,
            }
        }
        let (encoding, layout, vertices, frame, metadata) = header.finish().map_err(invalid)?;
        match encoding {
            Encoding::Binary => Ok(Self { reader, frame, layout, metadata, vertices, read: 0 }),
            Encoding::Ascii => Err(invalid(PlyError::Header("it is not binary".into()))),
        }
    }

    /// The next vertex; `None` after the last.
    pub(in crate::cloud::formats) fn next(&mut self) -> io::Result<Option<Vertex>> {
        if self.read == self.vertices {
            let over = !self.reader.fill_buf()?.is_empty();
            return if over { Err(self.length()) } else { Ok(None) };
        }
        // The largest layout has 7 floats and 2 flags.
        let mut bytes = [0; 30];
        let size = self.layout.size();
        self.reader.read_exact(&mut bytes[..size]).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => self.length(),
            _ => error,
        })?;
        self.read += 1;
        let (floats, flags) = bytes[..size].as_chunks::<4>();
        let mut floats = floats.iter().map(|bytes| f32::from_le_bytes(*bytes));
        let mut float = || floats.next().unwrap_or_default();
        let mut vector = || {
            let vector = [float(), float(), float()];
            // Negating two axes is its own inverse.
            self.frame.from_lps(vector)
        };
        let point = vector();
        let normal = self.layout.normals.then(&mut vector);
        let error = self.layout.errors.then(float);
        let [planes, unique] = *flags else { return Err(self.length()) };
        Ok(Some(Vertex { point, normal, error, planes: planes & 7, unique: u8::from(unique != 0) }))
    }

    fn length(&self) -> io::Error {
        invalid(PlyError::Length { promised: self.vertices })
    }
}

/// One line without its end.
fn line(reader: &mut impl BufRead) -> io::Result<String> {
    let mut line = Vec::new();
    io::Read::take(reader, MAX_LINE).read_until(b'\n', &mut line)?;
    let text = line.strip_suffix(b"\n").and_then(|line| std::str::from_utf8(line).ok());
    text.map(str::to_owned).ok_or_else(|| invalid(PlyError::Header("its header does not end".into())))
}

fn invalid(error: PlyError) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, error)
}
