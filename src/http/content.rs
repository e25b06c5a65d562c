//! The bytes of a representation: in memory, or made piece by piece as the client takes them.

use std::io::{self, Write};
use std::ops::Range;

use axum::body::Body;
use bytes::Bytes;
use flate2::Compression;
use flate2::write::GzEncoder;
use futures_util::stream;
use sha2::{Digest, Sha256};

use crate::error::{Error, Result};

/// A piece is about so long.
const PIECE_BYTES: usize = 1 << 16;

/// What a representation consists of, without content coding.
pub(super) trait Content: Sized {
    /// Bytes of the whole.
    fn length(&self) -> u64;
    /// Names exactly these bytes.
    fn tag(&self) -> String;
    /// The bytes of a part.
    fn part(self, part: Range<u64>) -> Result<Body>;
    /// The whole, compressed, and how long that is if it is known. The same bytes for the same
    /// content: no time stands in the header.
    fn gzip(self) -> Result<(Body, Option<u64>)>;
}

impl Content for Bytes {
    fn length(&self) -> u64 {
        self.len() as u64
    }

    fn tag(&self) -> String {
        hex::encode(&Sha256::digest(self)[..16])
    }

    fn part(self, part: Range<u64>) -> Result<Body> {
        let bound = |at: u64| usize::try_from(at).unwrap_or(usize::MAX).min(self.len());
        Ok(Body::from(self.slice(bound(part.start)..bound(part.end))))
    }

    fn gzip(self) -> Result<(Body, Option<u64>)> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(&self).map_err(Error::internal)?;
        let bytes = encoder.finish().map_err(Error::internal)?;
        let length = bytes.len() as u64;
        Ok((Body::from(bytes), Some(length)))
    }
}

/// Bytes that are made one piece after another, on threads that may block.
pub(super) trait Pieces: Send {
    /// The next piece; `None` at the end. An error ends the answer early, so that its client can't
    /// take it for whole.
    fn piece(&mut self) -> io::Result<Option<Bytes>>;
}

/// Begins a content's pieces at that byte.
pub(super) type Begin = Box<dyn FnOnce(u64) -> Result<Box<dyn Pieces>> + Send>;

/// Content that is never whole in memory.
pub(super) struct Streamed {
    pub(super) length: u64,
    /// Names exactly these bytes.
    pub(super) tag: String,
    pub(super) begin: Begin,
}

impl Content for Streamed {
    fn length(&self) -> u64 {
        self.length
    }

    fn tag(&self) -> String {
        self.tag.clone()
    }

    fn part(self, part: Range<u64>) -> Result<Body> {
        let pieces = (self.begin)(part.start)?;
        let left = part.end.saturating_sub(part.start);
        Ok(body(Box::new(UpTo { pieces, left })))
    }

    fn gzip(self) -> Result<(Body, Option<u64>)> {
        let pieces = (self.begin)(0)?;
        let encoder = Some(GzEncoder::new(Vec::new(), Compression::fast()));
        Ok((body(Box::new(Gzip { pieces, encoder })), None))
    }
}

/// A body that asks for the next piece when the client has room for it. A thread is busy only while
/// a piece is made, however slowly the client takes them.
fn body(pieces: Box<dyn Pieces>) -> Body {
    Body::from_stream(stream::unfold(Some(pieces), |pieces| async move {
        let mut pieces = pieces?;
        let made = tokio::task::spawn_blocking(move || {
            let piece = pieces.piece();
            (piece, pieces)
        });
        match made.await {
            Ok((Ok(Some(piece)), pieces)) => Some((Ok(piece), Some(pieces))),
            Ok((Ok(None), _)) => None,
            Ok((Err(error), _)) => Some((Err(error), None)),
            Err(panic) => Some((Err(io::Error::other(panic)), None)),
        }
    }))
}

/// Passes over the first bytes of pieces that can't begin later.
pub(super) struct After {
    pub(super) pieces: Box<dyn Pieces>,
    pub(super) skip: u64,
}

impl Pieces for After {
    fn piece(&mut self) -> io::Result<Option<Bytes>> {
        while let Some(mut piece) = self.pieces.piece()? {
            let skipped = self.skip.min(piece.len() as u64);
            self.skip -= skipped;
            // At most the piece's length, so it is a usize.
            let rest = piece.split_off(usize::try_from(skipped).unwrap_or(usize::MAX));
            if !rest.is_empty() {
                return Ok(Some(rest));
            }
        }
        Ok(None)
    }
}

/// So many bytes, and not fewer.
struct UpTo {
    pieces: Box<dyn Pieces>,
    left: u64,
}

impl Pieces for UpTo {
    fn piece(&mut self) -> io::Result<Option<Bytes>> {
        if self.left == 0 {
            return Ok(None);
        }
        let Some(mut piece) = self.pieces.piece()? else {
            return Err(io::ErrorKind::UnexpectedEof.into());
        };
        piece.truncate(usize::try_from(self.left).unwrap_or(usize::MAX));
        self.left -= piece.len() as u64;
        Ok(Some(piece))
    }
}

/// Pieces, compressed.
struct Gzip {
    pieces: Box<dyn Pieces>,
    /// `None` once the end is written.
    encoder: Option<GzEncoder<Vec<u8>>>,
}

impl Pieces for Gzip {
    fn piece(&mut self) -> io::Result<Option<Bytes>> {
        let Some(encoder) = &mut self.encoder else { return Ok(None) };
        while encoder.get_ref().len() < PIECE_BYTES {
            let Some(piece) = self.pieces.piece()? else {
                let rest = self.encoder.take().map_or_else(|| Ok(Vec::new()), GzEncoder::finish)?;
                return Ok(Some(rest.into()));
            };
            encoder.write_all(&piece)?;
        }
        Ok(Some(std::mem::take(encoder.get_mut()).into()))
    }
}
