//! The body of a request, chunk by chunk: never whole in memory (but for small JSON), never more
//! than its limit, and it must make progress.

use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::body::{Body, BodyDataStream};
use bytes::{Bytes, BytesMut};
use futures_util::StreamExt;

use super::upload::Upload;
use crate::config::Http;
use crate::crowd::Pace;
use crate::error::{Error, Result};

/// After a refusal, what may still come of the body and for how long we take it, so that the
/// client reads the answer instead of failing to write.
const LINGER_BYTES: u64 = 64 << 20;
const LINGER_TIME: Duration = Duration::from_secs(5);

/// A body that is being received.
pub(super) struct Incoming {
    stream: BodyDataStream,
    received: u64,
    limit_bytes: u64,
    setting: &'static str,
    idle_timeout: Duration,
    pace: Pace,
    upload: Option<Arc<Upload>>,
    /// Nothing more is to be waited for: the client is slow or gone.
    over: bool,
}

impl Incoming {
    /// A body of up to `http.max_body_bytes`.
    pub(super) fn json(body: Body, settings: &Http) -> Self {
        Self {
            stream: body.into_data_stream(),
            received: 0,
            limit_bytes: settings.max_body_bytes,
            setting: "http.max_body_bytes",
            idle_timeout: settings.idle_timeout,
            pace: Pace::new(settings.min_bytes_per_second, settings.rate_grace),
            upload: None,
            over: false,
        }
    }

    /// A body of up to `http.max_upload_bytes`.
    pub(super) fn upload(body: Body, settings: &Http, upload: Arc<Upload>) -> Self {
        Self {
            limit_bytes: settings.max_upload_bytes,
            setting: "http.max_upload_bytes",
            upload: Some(upload),
            ..Self::json(body, settings)
        }
    }

    /// The next bytes; `None` at the end.
    ///
    /// # Errors
    /// [`Error::RequestTimeout`] if none come for `http.idle_timeout`, if they come too slowly, or if
    /// the upload has lost its place; [`Error::TooLarge`] beyond the limit, [`Error::MalformedUpload`] if the connection ends before the body does.
    pub(super) async fn chunk(&mut self) -> Result<Option<Bytes>> {
        let begun = Instant::now();
        let limit = self.idle_timeout.min(self.pace.left());
        let upload = self.upload.clone();
        let displaced = async {
            match &upload {
                Some(upload) => upload.displaced().await,
                None => std::future::pending().await,
            }
        };
        let next = tokio::time::timeout(limit, self.stream.next());
        let next = tokio::select! {
            next = next => next.map_err(|_| ()),
            () = displaced => Err(()),
        };
        let chunk = match next {
            Ok(Some(Ok(chunk))) => chunk,
            Ok(None) => {
                if let Some(upload) = &upload {
                    upload.whole();
                }
                return Ok(None);
            }
            Ok(Some(Err(cause))) => {
                self.over = true;
                return Err(Error::MalformedUpload(format!("the body broke off: {cause}")));
            }
            Err(()) => {
                self.over = true;
                return Err(Error::RequestTimeout);
            }
        };
        self.pace.moved(begun.elapsed(), chunk.len());
        if let Some(upload) = &upload {
            upload.received(chunk.len());
        }
        self.received = self.received.saturating_add(chunk.len() as u64);
        if self.received > self.limit_bytes {
            return Err(Error::TooLarge { limit_bytes: self.limit_bytes, setting: self.setting });
        }
        Ok(Some(chunk))
    }

    /// All of it in memory.
    ///
    /// # Errors
    /// As for [`Incoming::chunk`]; the whole must come within one `http.idle_timeout`.
    pub(super) async fn whole(mut self) -> Result<Bytes> {
        let limit = self.idle_timeout;
        let all = async {
            let mut bytes = BytesMut::new();
            while let Some(chunk) = self.chunk().await? {
                bytes.extend_from_slice(&chunk);
            }
            Ok(bytes.freeze())
        };
        tokio::time::timeout(limit, all).await.map_err(|_| Error::RequestTimeout)?
    }

    /// Takes and drops what still comes, within limits.
    pub(super) async fn linger(mut self) {
        if self.over {
            return;
        }
        let until = self.received.saturating_add(LINGER_BYTES);
        let rest = async {
            while let Some(Ok(chunk)) = self.stream.next().await {
                self.received = self.received.saturating_add(chunk.len() as u64);
                if self.received > until {
                    break;
                }
            }
        };
        // Whether it ended or time did, the answer goes out now.
        let _ended = tokio::time::timeout(LINGER_TIME, rest).await;
    }
}
