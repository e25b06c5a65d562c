//! The listener: connections, their limits and timeouts, and how they end.

use std::net::IpAddr;
use std::time::Duration;

use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::net::{TcpListener, TcpStream};
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

use super::door::{Arrival, Door};
use super::timed_io::TimedIo;
use super::{AppState, router};
use crate::config;
use crate::crowd::{Connections, Limits, Pace, Peer, Place, Slow};
use crate::error::Result;

/// Requests that run at shutdown may end within this time.
const GRACE: Duration = Duration::from_secs(10);
/// Connections beyond the limits, in all and of one peer, on which probes are answered and others
/// are told so; the oldest make room for new ones.
const RESERVE: usize = 32;
const RESERVE_OF_PEER: usize = 8;
/// A request on one of them must come within this time.
const RESERVE_PATIENCE: Duration = Duration::from_secs(2);
/// Wait before the next accept when the system has no file descriptor left.
const ACCEPT_BACKOFF: Duration = Duration::from_millis(100);

/// Serves until `shutdown`; then lets the requests that run end, for up to ten seconds.
///
/// # Errors
/// None at present: a connection's fault ends that connection alone.
pub async fn serve(listener: TcpListener, state: AppState, shutdown: CancellationToken) -> Result<()> {
    let settings = state.config.http.clone();
    let names = ["http.max_connections", "http.max_connections_per_address"];
    let connections = Connections::new(Limits {
        max: settings.max_connections,
        max_per_peer: settings.max_connections_per_address,
        names,
        patience: settings.idle_timeout,
        crowded_bytes_per_second: settings.crowded_bytes_per_second,
        slow: Slow::Any,
        least_wait: Duration::ZERO,
        shrinks: true,
    });
    let reserve = Connections::new(Limits {
        max: RESERVE,
        max_per_peer: RESERVE_OF_PEER,
        names,
        patience: RESERVE_PATIENCE.min(settings.idle_timeout),
        crowded_bytes_per_second: settings.crowded_bytes_per_second,
        slow: Slow::Any,
        least_wait: Duration::ZERO,
        shrinks: true,
    });
    let door = Door::new(router::router(state, shutdown.clone()), &settings);
    let tasks = TaskTracker::new();
    loop {
        let (stream, address) = tokio::select! {
            () = shutdown.cancelled() => break,
            accepted = listener.accept() => match accepted {
                Ok((stream, peer)) => (stream, peer.ip().to_canonical()),
                Err(cause) => {
                    tracing::warn!(error = %cause, "a connection can't be accepted");
                    tokio::time::sleep(ACCEPT_BACKOFF).await;
                    continue;
                }
            },
        };
        let peer = Peer::from(address);
        let (place, probes_alone) = match connections.admit(peer, door.is_proxy(address)) {
            Ok(place) => (place, false),
            Err(limit) => match reserve.admit(peer, false) {
                Ok(place) => {
                    tracing::debug!(limit = limit.0, "a limit of connections is reached");
                    (place, true)
                }
                // All of the reserve is at work on its one request: there is nobody to tell.
                Err(_) => continue,
            },
        };
        let accepted = Accepted { stream, address, place, probes_alone };
        tasks.spawn(connection(accepted, door.clone(), settings.clone(), shutdown.clone()));
    }
    drop(listener);
    tasks.close();
    if tokio::time::timeout(GRACE, tasks.wait()).await.is_err() {
        tracing::warn!("requests that still ran {GRACE:?} after shutdown were dropped");
    }
    Ok(())
}

struct Accepted {
    stream: TcpStream,
    address: IpAddr,
    place: Place,
    probes_alone: bool,
}

async fn connection(accepted: Accepted, door: Door, settings: config::Http, shutdown: CancellationToken) {
    let Accepted { stream, address, place, probes_alone } = accepted;
    if let Err(cause) = stream.set_nodelay(true) {
        tracing::debug!(error = %cause, "TCP_NODELAY can't be set");
    }
    let arrival = Arrival { address, connection: place.member().clone(), probes_alone };
    let pace = Pace::new(settings.min_bytes_per_second, settings.rate_grace);
    let io = TokioIo::new(TimedIo::new(stream, settings.idle_timeout, pace, place.member().clone()));
    let service = service_fn(move |request| door.clone().enter(arrival.clone(), request));
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .keep_alive(!probes_alone)
        // From the connection's begin, or the last answer's end, to the end of the next head.
        .header_read_timeout(place.patience())
        .serve_connection(io, service);
    let mut connection = std::pin::pin!(connection);
    let ended = tokio::select! {
        ended = connection.as_mut() => ended,
        () = place.closed() => {
            tracing::debug!("a connection that waited for a request was closed for others");
            return;
        }
        () = shutdown.cancelled() => {
            connection.as_mut().graceful_shutdown();
            connection.await
        }
    };
    if let Err(cause) = ended {
        tracing::debug!(error = %cause, "a connection ended early");
    }
}
