//! The listener: connections, their limits and timeouts, and how they end.

use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

use super::problem::{MEDIA_TYPE, Problem};
use super::timed_io::TimedIo;
use super::{AppState, router};
use crate::config;
use crate::error::{Error, Result};

/// Requests that run at shutdown may end within this time.
const GRACE: Duration = Duration::from_secs(10);
/// A connection beyond the limit is told so within this time, or not at all.
const REFUSAL: Duration = Duration::from_secs(1);
/// Connections beyond the limit that are told so at a time; more are closed without a word.
const REFUSALS: usize = 16;
/// Of a refused request, so much is taken and dropped.
const REFUSED_BYTES: u64 = 64 * 1024;
/// Wait before the next accept when the system has no file descriptor left.
const ACCEPT_BACKOFF: Duration = Duration::from_millis(100);

/// Serves until `shutdown`; then lets the requests that run end, for up to ten seconds.
///
/// # Errors
/// None at present: a connection's fault ends that connection alone.
pub async fn serve(listener: TcpListener, state: AppState, shutdown: CancellationToken) -> Result<()> {
    let settings = state.config.http.clone();
    let connections = std::sync::Arc::new(Semaphore::new(settings.max_connections));
    let refusals = std::sync::Arc::new(Semaphore::new(REFUSALS));
    let service = router::router(state, shutdown.clone());
    let tasks = TaskTracker::new();
    loop {
        let stream = tokio::select! {
            () = shutdown.cancelled() => break,
            accepted = listener.accept() => match accepted {
                Ok((stream, _)) => stream,
                Err(cause) => {
                    tracing::warn!(error = %cause, "a connection can't be accepted");
                    tokio::time::sleep(ACCEPT_BACKOFF).await;
                    continue;
                }
            },
        };
        if let Ok(permit) = connections.clone().try_acquire_owned() {
            let connection = connection(stream, service.clone(), settings.clone(), shutdown.clone(), permit);
            tasks.spawn(connection);
        } else if let Ok(permit) = refusals.clone().try_acquire_owned() {
            tracing::warn!(limit = settings.max_connections, "http.max_connections is reached");
            tasks.spawn(refuse(stream, permit));
        }
    }
    drop(listener);
    tasks.close();
    if tokio::time::timeout(GRACE, tasks.wait()).await.is_err() {
        tracing::warn!("requests that still ran {GRACE:?} after shutdown were dropped");
    }
    Ok(())
}

async fn connection(
    stream: TcpStream,
    service: Router,
    settings: config::Http,
    shutdown: CancellationToken,
    permit: OwnedSemaphorePermit,
) {
    if let Err(cause) = stream.set_nodelay(true) {
        tracing::debug!(error = %cause, "TCP_NODELAY can't be set");
    }
    let io = TokioIo::new(TimedIo::new(stream, settings.idle_timeout));
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        // From the connection's begin, or the last answer's end, to the end of the next head.
        .header_read_timeout(settings.idle_timeout)
        .serve_connection(io, TowerToHyperService::new(service));
    let mut connection = std::pin::pin!(connection);
    let ended = tokio::select! {
        ended = connection.as_mut() => ended,
        () = shutdown.cancelled() => {
            connection.as_mut().graceful_shutdown();
            connection.await
        }
    };
    if let Err(cause) = ended {
        tracing::debug!(error = %cause, "a connection ended early");
    }
    drop(permit);
}

/// Answers 503 without reading the request.
async fn refuse(mut stream: TcpStream, permit: OwnedSemaphorePermit) {
    let problem = Problem::of(&Error::Busy("http.max_connections is reached"));
    let body = serde_json::to_string(&problem).unwrap_or_default();
    let answer = format!(
        "HTTP/1.1 503 Service Unavailable\r\ncontent-type: {MEDIA_TYPE}\r\ncontent-length: {}\r\n\
         retry-after: 5\r\nconnection: close\r\n\r\n{body}",
        body.len()
    );
    let told = async {
        stream.write_all(answer.as_bytes()).await?;
        stream.shutdown().await?;
        // Closing with unread bytes would reset the connection before the answer is read.
        tokio::io::copy(&mut stream.take(REFUSED_BYTES), &mut tokio::io::sink()).await
    };
    if tokio::time::timeout(REFUSAL, told).await.is_err() {
        tracing::debug!("a connection beyond the limit did not take its refusal");
    }
    drop(permit);
}
