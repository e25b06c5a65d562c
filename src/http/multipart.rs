//! Multipart bodies (RFC 2046 section 5.1), part by part and chunk by chunk: `multipart/related`
//! of STOW-RS and `multipart/form-data` of a browser. Nothing but one chunk, a boundary's length
//! and one part's headers is ever held.

use bytes::{Buf, Bytes, BytesMut};
use memchr::memmem::Finder;

use super::body::Incoming;
use super::media_type::MediaType;
use crate::error::{Error, Result};

/// Headers of one part, in all.
const MAX_HEADER_BYTES: usize = 16 * 1024;
/// What may stand before the first boundary.
const MAX_PREAMBLE_BYTES: usize = 64 * 1024;
/// RFC 2046: a boundary has 1 to 70 characters.
const MAX_BOUNDARY: usize = 70;

/// What a part says of itself.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct PartHeaders {
    /// `Content-Type`, if it has one that can be read.
    pub(super) media_type: Option<MediaType>,
    /// `filename` of `Content-Disposition`.
    pub(super) file_name: Option<String>,
    /// `name` of `Content-Disposition`.
    pub(super) name: Option<String>,
}

impl PartHeaders {
    fn parse(block: &str) -> Self {
        let mut headers = Self::default();
        for line in block.split("\r\n") {
            let Some((name, value)) = line.split_once(':') else { continue };
            if name.eq_ignore_ascii_case("content-type") {
                headers.media_type = MediaType::parse(value);
            } else if name.eq_ignore_ascii_case("content-disposition") {
                let disposition = MediaType::parse_parameters(value);
                let parameter = |name: &str| {
                    disposition.iter().find(|(key, _)| key == name).map(|(_, value)| value.clone())
                };
                headers.name = parameter("name");
                headers.file_name = parameter("filename");
            }
        }
        headers
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Before the first boundary.
    Preamble,
    /// A boundary has been read: what comes tells whether a part follows.
    AfterBoundary,
    /// In a part's content.
    Content,
    /// After the last boundary.
    End,
}

/// A multipart body that is being read.
pub(super) struct Multipart {
    incoming: Incoming,
    buffer: BytesMut,
    /// CR LF `--` boundary.
    delimiter: Finder<'static>,
    state: State,
}

impl Multipart {
    /// The parts of a body, by the boundary of its Content-Type.
    ///
    /// # Errors
    /// [`Error::MalformedUpload`] without a valid boundary.
    pub(super) fn new(incoming: Incoming, media_type: &MediaType) -> Result<Self> {
        let boundary = media_type.parameter("boundary").unwrap_or("");
        if !(1..=MAX_BOUNDARY).contains(&boundary.len()) {
            return Err(malformed("Content-Type needs a boundary of 1 to 70 characters"));
        }
        let delimiter = Finder::new(format!("\r\n--{boundary}").as_bytes()).into_owned();
        // The first boundary need not have a line before it.
        let buffer = BytesMut::from(&b"\r\n"[..]);
        Ok(Self { incoming, buffer, delimiter, state: State::Preamble })
    }

    /// The next part's headers; `None` after the last. What is left of the part before is skipped.
    ///
    /// # Errors
    /// [`Error::MalformedUpload`], and what [`Incoming::chunk`] refuses.
    pub(super) async fn next_part(&mut self) -> Result<Option<PartHeaders>> {
        if self.state == State::Preamble {
            self.skip_preamble().await?;
        }
        while self.chunk().await?.is_some() {}
        if self.state == State::End || !self.a_part_follows().await? {
            self.state = State::End;
            return Ok(None);
        }
        let headers = self.headers().await?;
        self.state = State::Content;
        Ok(Some(headers))
    }

    /// The next bytes of the part's content; `None` at its end.
    ///
    /// # Errors
    /// [`Error::MalformedUpload`] if the body ends without a boundary, and what
    /// [`Incoming::chunk`] refuses.
    pub(super) async fn chunk(&mut self) -> Result<Option<Bytes>> {
        if self.state != State::Content {
            return Ok(None);
        }
        loop {
            if let Some(at) = self.delimiter.find(&self.buffer) {
                let last = self.buffer.split_to(at).freeze();
                if last.is_empty() {
                    self.buffer.advance(self.delimiter.needle().len());
                    self.state = State::AfterBoundary;
                    return Ok(None);
                }
                return Ok(Some(last));
            }
            // All but what may be the beginning of a delimiter is content.
            let safe = (self.buffer.len() + 1).saturating_sub(self.delimiter.needle().len());
            if safe > 0 {
                return Ok(Some(self.buffer.split_to(safe).freeze()));
            }
            self.more("the last boundary is missing").await?;
        }
    }

    /// Takes and drops what still comes.
    pub(super) async fn linger(self) {
        self.incoming.linger().await;
    }

    async fn skip_preamble(&mut self) -> Result<()> {
        let mut skipped = 0;
        loop {
            if let Some(at) = self.delimiter.find(&self.buffer) {
                self.buffer.advance(at + self.delimiter.needle().len());
                self.state = State::AfterBoundary;
                return Ok(());
            }
            let safe = (self.buffer.len() + 1).saturating_sub(self.delimiter.needle().len());
            self.buffer.advance(safe);
            skipped += safe;
            if skipped > MAX_PREAMBLE_BYTES {
                return Err(malformed("the first boundary does not come"));
            }
            self.more("there is no boundary in the body").await?;
        }
    }

    /// After a boundary: `--` ends the body, padding and a line break begin a part.
    async fn a_part_follows(&mut self) -> Result<bool> {
        let mut padding = 0;
        loop {
            while self.buffer.len() < 2 {
                self.more("the body breaks off after a boundary").await?;
            }
            if self.buffer.starts_with(b"\r\n") {
                // The line break stays: a part without headers begins with an empty line.
                return Ok(true);
            }
            if padding == 0 && self.buffer.starts_with(b"--") {
                return Ok(false);
            }
            if !matches!(self.buffer.first(), Some(b' ' | b'\t')) || padding > MAX_HEADER_BYTES {
                return Err(malformed("a boundary is followed by something else than a line break"));
            }
            self.buffer.advance(1);
            padding += 1;
        }
    }

    /// Reads up to the empty line.
    async fn headers(&mut self) -> Result<PartHeaders> {
        let end = loop {
            if let Some(at) = memchr::memmem::find(&self.buffer, b"\r\n\r\n") {
                break at;
            }
            if self.buffer.len() > MAX_HEADER_BYTES {
                return Err(malformed("the headers of a part are too long"));
            }
            self.more("the body breaks off in the headers of a part").await?;
        };
        let block = self.buffer.split_to(end);
        self.buffer.advance(4);
        Ok(PartHeaders::parse(&String::from_utf8_lossy(&block)))
    }

    async fn more(&mut self, else_malformed: &str) -> Result<()> {
        let chunk = self.incoming.chunk().await?.ok_or_else(|| malformed(else_malformed))?;
        self.buffer.extend_from_slice(&chunk);
        Ok(())
    }
}

fn malformed(what: &str) -> Error {
    Error::MalformedUpload(what.to_owned())
}

#[cfg(test)]
mod tests {
    use axum::body::Body;
    use futures_util::stream;

    use std::net::IpAddr;

    use super::*;
    use crate::config::Config;
    use crate::crowd::Peer;
    use crate::http::upload::Uploads;
    use crate::memory::Memory;

    /// The parts of `body` when it arrives in pieces of `size` bytes.
    async fn parts(content_type: &str, body: &[u8], size: usize) -> Result<Vec<(PartHeaders, Vec<u8>)>> {
        let pieces: Vec<_> =
            body.chunks(size).map(|piece| Ok::<_, std::io::Error>(Bytes::copy_from_slice(piece))).collect();
        let settings = Config::defaults().http;
        let place = Uploads::new(&settings, Memory::unlimited())
            .take(Peer::from(IpAddr::from([127, 0, 0, 1])))
            .unwrap();
        let body = Body::from_stream(stream::iter(pieces));
        let incoming = Incoming::upload(body, &settings, place.upload().clone());
        let mut multipart = Multipart::new(incoming, &MediaType::parse(content_type).unwrap())?;
        let mut parts = Vec::new();
        while let Some(headers) = multipart.next_part().await? {
            let mut content = Vec::new();
            while let Some(chunk) = multipart.chunk().await? {
                content.extend_from_slice(&chunk);
            }
            parts.push((headers, content));
        }
        Ok(parts)
    }

    const RELATED: &str = "multipart/related; type=\"application/dicom\"; boundary=\"=_b 1\"";

    #[tokio::test]
    async fn content_with_line_breaks_and_half_boundaries_is_kept_however_it_is_cut() {
        let content = b"\r\n\r\n--=_b\r\r\n--=_b\n\0\xff--=_b 1\r\n-";
        let mut body = b"a preamble\r\n--=_b 1  \r\nContent-Type: application/dicom\r\n\r\n".to_vec();
        body.extend_from_slice(content);
        body.extend_from_slice(
            b"\r\n--=_b 1\r\n\r\nsecond\r\n--=_b 1\r\nX: y\r\n\r\n\r\n--=_b 1--\r\nepilogue",
        );
        for size in [1, 2, 3, 7, 1000] {
            let parts = parts(RELATED, &body, size).await.unwrap();
            assert_eq!(parts.len(), 3, "in pieces of {size}");
            assert_eq!(parts[0].1, content);
            assert_eq!(parts[0].0.media_type.as_ref().unwrap().essence(), "application/dicom");
            assert_eq!(parts[1], (PartHeaders::default(), b"second".to_vec()));
            assert_eq!(parts[2].1, b"");
        }
    }

    #[tokio::test]
    async fn a_browsers_form_tells_names() {
        let body = b"--x\r\nContent-Disposition: form-data; name=\"files\"; filename=\"a \\\"b\\\".zip\"\r\n\r\n1\r\n--x--";
        let parts = parts("multipart/form-data; boundary=x", body, 5).await.unwrap();
        assert_eq!(parts[0].0.name.as_deref(), Some("files"));
        assert_eq!(parts[0].0.file_name.as_deref(), Some("a \"b\".zip"));
    }

    #[tokio::test]
    async fn a_body_that_breaks_off_is_refused() {
        let whole = b"--x\r\nA: b\r\n\r\ncontent\r\n--x--";
        for end in 0..whole.len() {
            let got = parts("multipart/related; boundary=x", &whole[..end], 4).await;
            assert!(matches!(got, Err(Error::MalformedUpload(_))), "cut at {end}: {got:?}");
        }
        assert_eq!(parts("multipart/related; boundary=x", whole, 4).await.unwrap().len(), 1);
    }

    #[tokio::test]
    async fn endless_headers_and_preambles_are_refused() {
        for prefix in ["--x\r\nA: ", "", "--x "] {
            let mut body = prefix.as_bytes().to_vec();
            body.resize(1 << 20, b' ');
            let got = parts("multipart/related; boundary=x", &body, 1000).await;
            assert!(matches!(got, Err(Error::MalformedUpload(_))), "{prefix:?}: {got:?}");
        }
    }
}
