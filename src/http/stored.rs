//! Stored clouds as answers that are never whole in memory.

use std::io;
use std::sync::Arc;

use bytes::Bytes;
use sha2::{Digest, Sha256};

use super::Context;
use super::content::{After, Begin, Pieces, Streamed};
use crate::cloud::{Conversion, ConversionError, Converting, Format, MaxError};
use crate::error::{Error, Result};
use crate::geometry::Frame;
use crate::memory::Share;
use crate::store::{HashedFile, ReconstructionId};
use crate::telemetry::Metrics;

/// What one answer holds at most while it is sent: a block, a piece of it in another form, the coding's
/// window, and what waits for the socket.
const ANSWER_BYTES: u64 = 1 << 20;

/// How a stored cloud is asked for.
#[derive(Debug, Clone, Copy)]
pub(super) struct As {
    pub(super) format: Format,
    pub(super) frame: Frame,
    pub(super) max_error: Option<MaxError>,
}

impl As {
    /// As it is stored: binary PLY in LPS with all points.
    fn is_stored(self) -> bool {
        (self.format, self.frame, self.max_error) == (Format::PlyBinary, Frame::Lps, None)
    }

    /// Names the bytes that a stored file gives in this form.
    fn tag(self, stored: &[u8; 32]) -> String {
        if self.is_stored() {
            return hex::encode(&stored[..16]);
        }
        let mut hash = Sha256::new_with_prefix(stored);
        let filter = self.max_error.map_or(String::new(), |most| most.to_string());
        // The software too: another version may write the same cloud in other bytes.
        for part in [self.format.name(), self.frame.name(), &filter, crate::SOFTWARE] {
            hash.update(part);
            hash.update([0]);
        }
        hex::encode(&hash.finalize()[..16])
    }
}

/// The cloud in `file`, the result of reconstruction `id`, in that form. Reads the file: not for
/// tokio's threads.
///
/// # Errors
/// [`Error::Busy`] without memory, [`Error::ResultDamaged`], [`Error::NoExpectedErrors`], [`Error::EmptyCloud`].
pub(super) fn cloud(
    context: &Context,
    id: ReconstructionId,
    mut file: HashedFile,
    form: As,
) -> Result<Streamed> {
    let watch =
        Watch { id, metrics: Arc::clone(&context.metrics), _share: context.memory.take(ANSWER_BYTES)? };
    let tag = form.tag(&file.identity().map_err(|error| watch.refused(error))?);
    if form.is_stored() {
        let length = file.length();
        let begin: Begin = Box::new(move |start| {
            file.go_to(start).map_err(|error| watch.refused(error))?;
            Ok(Box::new(Watched { pieces: Stored(file), watch }))
        });
        return Ok(Streamed { length, tag, begin });
    }
    let conversion = Conversion::of(&mut file, form.format, form.frame, form.max_error);
    let conversion = conversion.map_err(|error| match error {
        ConversionError::Unfiltered(error) => error.into(),
        ConversionError::Io(error) => watch.refused(error),
    })?;
    let length = conversion.length();
    let begin: Begin = Box::new(move |start| {
        let begun = file.go_to(0).and_then(|()| conversion.begin(file));
        let converting = begun.map_err(|error| watch.refused(error))?;
        let pieces = Box::new(Watched { pieces: converting, watch });
        Ok(Box::new(After { pieces, skip: start }))
    });
    Ok(Streamed { length, tag, begin })
}

/// Tells of a result that turns out to be damaged, and holds the answer's memory.
struct Watch {
    id: ReconstructionId,
    metrics: Arc<Metrics>,
    _share: Share,
}

impl Watch {
    /// The refusal that an error before the first byte becomes.
    fn refused(&self, error: io::Error) -> Error {
        let error = Error::of_result(self.id, error);
        self.tell(&error);
        error
    }

    fn tell(&self, error: &Error) {
        if let Error::ResultDamaged { damage, .. } = error {
            self.metrics.result_damaged();
            tracing::error!(reconstruction = %self.id, damage, "a stored result is damaged");
        }
    }
}

/// Pieces of which an error is told.
struct Watched<P> {
    pieces: P,
    watch: Watch,
}

impl<P: Pieces> Pieces for Watched<P> {
    fn piece(&mut self) -> io::Result<Option<Bytes>> {
        let piece = self.pieces.piece();
        piece.map_err(|error| {
            let error = Error::of_result(self.watch.id, error);
            self.watch.tell(&error);
            tracing::error!(reconstruction = %self.watch.id, error = ?error, "an answer was broken off");
            io::Error::other(error)
        })
    }
}

/// A file as it is stored.
struct Stored(HashedFile);

impl Pieces for Stored {
    fn piece(&mut self) -> io::Result<Option<Bytes>> {
        Ok(self.0.block()?.map(Bytes::copy_from_slice))
    }
}

impl Pieces for Converting<HashedFile> {
    fn piece(&mut self) -> io::Result<Option<Bytes>> {
        Ok(Converting::piece(self)?.map(Bytes::from))
    }
}
