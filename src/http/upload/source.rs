//! Where the bytes of one file of a request come from.

use bytes::Bytes;

use crate::error::Result;
use crate::http::body::Incoming;
use crate::http::multipart::Multipart;

/// The whole body, or a part of it.
pub(in crate::http) enum Source<'a> {
    Body(&'a mut Incoming),
    Part(&'a mut Multipart),
}

impl Source<'_> {
    /// The next bytes; `None` at the end of the file.
    ///
    /// # Errors
    /// Those of [`Incoming::chunk`] and [`Multipart::chunk`].
    pub(in crate::http) async fn chunk(&mut self) -> Result<Option<Bytes>> {
        match self {
            Self::Body(incoming) => incoming.chunk().await,
            Self::Part(multipart) => multipart.chunk().await,
        }
    }
}
