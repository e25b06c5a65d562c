//! A stored cloud in another format, frame or with fewer points, made piece by piece: neither the
//! stored cloud nor what it becomes is ever whole in memory.

use std::io::{self, BufRead};

use super::ply::StoredCloud;
use super::vertex::Vertex;
use super::{Format, Writer};
use crate::cloud::{MaxError, NoErrors, Unfiltered};
use crate::geometry::Frame;

/// About so many bytes are made at a time.
const PIECE_BYTES: usize = 1 << 16;

/// What a stored cloud (binary PLY) is to become, and how long that is.
#[derive(Debug, Clone)]
pub struct Conversion {
    format: Format,
    frame: Frame,
    max_error: Option<MaxError>,
    header: Vec<u8>,
    points: usize,
    length: u64,
}

/// Why a stored cloud can't be converted.
#[derive(Debug, thiserror::Error)]
pub enum ConversionError {
    /// It can't be filtered: nothing is known to filter by, or no point would be left.
    #[error(transparent)]
    Unfiltered(#[from] Unfiltered),
    /// It can't be read, or is no binary PLY of ours.
    #[error(transparent)]
    Io(#[from] io::Error),
}

impl Conversion {
    /// Reads as much of `stored` as its length in the other form depends on: all of it for a filter
    /// and for text, its header otherwise. The result is the same bytes that [`super::encode`] gives
    /// for the same cloud.
    ///
    /// # Errors
    /// [`ConversionError`].
    pub fn of(
        stored: impl BufRead,
        format: Format,
        frame: Frame,
        max_error: Option<MaxError>,
    ) -> Result<Self, ConversionError> {
        let mut cloud = StoredCloud::open(stored)?;
        if max_error.is_some() && cloud.vertices > 0 && !cloud.layout.errors {
            return Err(Unfiltered::NoErrors(NoErrors).into());
        }
        let writer = format.row().writer;
        let each = (writer.vertex_bytes)(cloud.layout);
        let (mut points, mut body) = (cloud.vertices, 0);
        let mut least_mm: Option<f32> = None;
        if max_error.is_some() || each.is_none() {
            points = 0;
            let mut text = Vec::new();
            while let Some(vertex) = cloud.next()? {
                least_mm = least_mm.into_iter().chain(vertex.error).reduce(f32::min);
                if within(&vertex, max_error) {
                    points += 1;
                    text.clear();
                    (writer.vertex)(&vertex, frame, &mut text);
                    body += text.len() as u64;
                }
            }
        } else {
            body = points as u64 * each.unwrap_or_default() as u64;
        }
        if let (Some(limit), Some(least_mm), 0) = (max_error, least_mm, points) {
            return Err(Unfiltered::NothingLeft { limit, least_mm }.into());
        }
        let layout = cloud.layout.with_points(points);
        let mut metadata = cloud.metadata;
        metadata.max_error_mm = max_error.or(metadata.max_error_mm);
        let header = (writer.header)(points, layout, &metadata, frame);
        let length = header.len() as u64 + body;
        Ok(Self { format, frame, max_error, header, points, length })
    }

    /// Bytes of the whole.
    #[must_use]
    pub fn length(&self) -> u64 {
        self.length
    }

    /// Points of the whole.
    #[must_use]
    pub fn points(&self) -> usize {
        self.points
    }

    /// Begins with the same stored cloud, read anew.
    ///
    /// # Errors
    /// Those of reading its header.
    pub fn begin<R: BufRead>(self, stored: R) -> io::Result<Converting<R>> {
        let cloud = StoredCloud::open(stored)?;
        Ok(Converting {
            cloud,
            writer: self.format.row().writer,
            header: Some(self.header),
            frame: self.frame,
            max_error: self.max_error,
        })
    }
}

/// Whether a vertex stays.
fn within(vertex: &Vertex, max_error: Option<MaxError>) -> bool {
    max_error.is_none_or(|most| vertex.error.is_some_and(|error| error <= most.mm()))
}

/// A conversion under way.
#[derive(Debug)]
pub struct Converting<R> {
    cloud: StoredCloud<R>,
    writer: Writer,
    header: Option<Vec<u8>>,
    frame: Frame,
    max_error: Option<MaxError>,
}

impl<R: BufRead> Converting<R> {
    /// The next piece; `None` at the end.
    ///
    /// # Errors
    /// Those of reading the stored cloud.
    pub fn piece(&mut self) -> io::Result<Option<Vec<u8>>> {
        let mut piece = self.header.take().unwrap_or_default();
        piece.reserve(PIECE_BYTES + 512);
        while piece.len() < PIECE_BYTES {
            let Some(vertex) = self.cloud.next()? else { break };
            if within(&vertex, self.max_error) {
                (self.writer.vertex)(&vertex, self.frame, &mut piece);
            }
        }
        Ok((!piece.is_empty()).then_some(piece))
    }
}
