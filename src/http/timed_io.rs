//! A connection whose writes must make progress: a peer that asks for a cloud and then does not
//! read it, or reads it byte by byte, does not hold its connection.

use std::future::Future;
use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::time::{Instant, Sleep};

use crate::crowd::{Awaiting, Busy, Member, Pace};

/// A TCP connection with a limit on how long one write may wait, and on how slow all of them may be.
pub(super) struct TimedIo {
    stream: TcpStream,
    limit: Duration,
    pace: Pace,
    member: Arc<Member>,
    /// The write that waits now.
    waiting: Option<Waiting>,
}

struct Waiting {
    since: Instant,
    /// When it has waited too long.
    end: Pin<Box<Sleep>>,
    /// What is not sent yet must not be lost to somebody who needs the connection, unless the peer is slow.
    _busy: Busy,
    _awaiting: Awaiting,
}

impl TimedIo {
    pub(super) fn new(stream: TcpStream, limit: Duration, pace: Pace, member: Arc<Member>) -> Self {
        Self { stream, limit, pace, member, waiting: None }
    }

    fn timed<T>(
        &mut self,
        cx: &mut Context<'_>,
        write: Poll<io::Result<T>>,
        bytes: impl FnOnce(&T) -> usize,
    ) -> Poll<io::Result<T>> {
        if let Poll::Ready(result) = write {
            let waited = self.waiting.take().map_or(Duration::ZERO, |waiting| waiting.since.elapsed());
            let moved = result.as_ref().map_or(0, bytes);
            self.pace.moved(waited, moved);
            self.member.moved(moved);
            return Poll::Ready(result);
        }
        let (limit, member) = (self.limit.min(self.pace.left()), &self.member);
        let waiting = self.waiting.get_or_insert_with(|| {
            let since = Instant::now();
            Waiting {
                since,
                end: Box::pin(tokio::time::sleep_until(since + limit)),
                _busy: member.work(),
                _awaiting: member.wait_for_peer(),
            }
        });
        match waiting.end.as_mut().poll(cx) {
            Poll::Ready(()) => Poll::Ready(Err(io::ErrorKind::TimedOut.into())),
            Poll::Pending => Poll::Pending,
        }
    }
}

impl Drop for TimedIo {
    /// An answer that broke off ends with a reset: one to HTTP/1.0 may have neither length nor chunks, so
    /// that its client could take an ordinary end for that of the answer.
    fn drop(&mut self) {
        if self.member.is_broken()
            && let Err(cause) = self.stream.set_zero_linger()
        {
            tracing::debug!(error = %cause, "SO_LINGER can't be set");
        }
    }
}

impl AsyncRead for TimedIo {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(cx, buffer)
    }
}

impl AsyncWrite for TimedIo {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let write = Pin::new(&mut self.stream).poll_write(cx, bytes);
        self.timed(cx, write, |written| *written)
    }
    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffers: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let write = Pin::new(&mut self.stream).poll_write_vectored(cx, buffers);
        self.timed(cx, write, |written| *written)
    }
    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }
    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        let flush = Pin::new(&mut self.stream).poll_flush(cx);
        self.timed(cx, flush, |()| 0)
    }
    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        if self.member.is_broken() {
            return Poll::Ready(Ok(()));
        }
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}
