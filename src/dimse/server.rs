//! The listener: accepts connections, one task each, until the shutdown.

use std::sync::Arc;
use std::time::Duration;

use tokio::net::TcpListener;
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

use super::association;
use super::stop::Stop;
use crate::config;
use crate::crowd::{Connections, Limits, Peer, Slow};
use crate::intake::Intake;
use crate::telemetry::Metrics;

/// At shutdown, the time for messages on their way to be finished and answered.
const GRACE: Duration = Duration::from_secs(10);

/// Wait after the system could not accept a connection (too many open files).
const ACCEPT_PAUSE: Duration = Duration::from_millis(200);

/// What all associations share.
pub(crate) struct Shared {
    pub(crate) config: config::Dimse,
    /// Places of associations, from the request to the connection's end.
    pub(crate) associations: Arc<Connections>,
    pub(crate) intake: Intake,
    pub(crate) metrics: Arc<Metrics>,
}

/// Serves DICOM associations on `listener` until `shutdown`: Verification and Storage as SCP.
///
/// A connection takes a place of an association only when its request was read. Before that it
/// waits among others, of which the oldest make room when there are too many. When all places of
/// associations are taken, the one that has waited longest for its peer's next request makes room, or,
/// for a peer that has none, the slowest one of the peer that has the most.
///
/// At shutdown no further association is accepted, those that wait for a message are aborted, and
/// those within a message may finish it for a moment. Returns when all have ended.
pub async fn serve(
    listener: TcpListener,
    intake: Intake,
    config: config::Dimse,
    metrics: Arc<Metrics>,
    shutdown: CancellationToken,
) {
    let waiting = Connections::new(Limits {
        max: config.max_waiting,
        max_per_peer: config.max_waiting_per_peer,
        names: ["dimse.max_waiting", "dimse.max_waiting_per_peer"],
        patience: config.association_timeout,
        crowded_bytes_per_second: 0,
        slow: Slow::Any,
        least_wait: Duration::ZERO,
        shrinks: true,
    });
    let associations = Connections::new(Limits {
        max: config.max_associations,
        max_per_peer: config.max_associations_per_peer,
        names: ["dimse.max_associations", "dimse.max_associations_per_peer"],
        patience: config.idle_timeout,
        least_wait: config.gives_way_after,
        shrinks: false,
        crowded_bytes_per_second: config.crowded_bytes_per_second,
        slow: Slow::OfTheCrowded,
    });
    let shared = Arc::new(Shared { config, associations, intake, metrics });
    let stop = Stop { soon: shutdown.clone(), now: CancellationToken::new() };
    let tasks = TaskTracker::new();
    loop {
        let accepted = tokio::select! {
            biased;
            () = shutdown.cancelled() => break,
            accepted = listener.accept() => accepted,
        };
        let (stream, peer) = match accepted {
            Ok(accepted) => accepted,
            Err(error) => {
                tracing::warn!(%error, "a connection could not be accepted");
                tokio::time::sleep(ACCEPT_PAUSE).await;
                continue;
            }
        };
        let place = match waiting.admit(Peer::from(peer.ip()), false) {
            Ok(place) => place,
            Err(limit) => {
                tracing::warn!(%peer, limit = limit.0, "too many connections, closed");
                continue;
            }
        };
        tasks.spawn(association::serve(stream, peer, place, Arc::clone(&shared), stop.clone()));
    }
    drop(listener);
    tasks.close();
    if timeout(GRACE, tasks.wait()).await.is_err() {
        stop.now.cancel();
        tasks.wait().await;
    }
}
