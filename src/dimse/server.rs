//! The listener: accepts connections, one task each, until the shutdown.

use std::sync::Arc;
use std::time::Duration;

use tokio::net::TcpListener;
use tokio::sync::Semaphore;
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

use super::admission::Admission;
use super::association;
use super::stop::Stop;
use crate::config;
use crate::intake::Intake;
use crate::telemetry::Metrics;

/// Connections beyond the limits that are told so at a time; further ones are just closed.
const MAX_REFUSALS: usize = 16;

/// At shutdown, the time for messages on their way to be finished and answered.
const GRACE: Duration = Duration::from_secs(10);

/// Wait after the system could not accept a connection (too many open files).
const ACCEPT_PAUSE: Duration = Duration::from_millis(200);

/// What all associations share.
pub(crate) struct Shared {
    pub(crate) config: config::Dimse,
    pub(crate) intake: Intake,
    pub(crate) metrics: Arc<Metrics>,
}

/// Serves DICOM associations on `listener` until `shutdown`: Verification and Storage as SCP.
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
    let admission = Admission::new(config.max_associations, config.max_associations_per_peer);
    let refusals = Arc::new(Semaphore::new(MAX_REFUSALS));
    let shared = Arc::new(Shared { config, intake, metrics });
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
        let slot = admission.admit(peer.ip());
        let refusal = match &slot {
            Ok(_) => None,
            Err(limit) => match Arc::clone(&refusals).try_acquire_owned() {
                Ok(permit) => Some(permit),
                Err(_) => {
                    tracing::warn!(%peer, limit = limit.0, "too many connections, closed");
                    continue;
                }
            },
        };
        let (shared, stop) = (Arc::clone(&shared), stop.clone());
        tasks.spawn(async move {
            association::serve(stream, peer, slot, shared, stop).await;
            drop(refusal);
        });
    }
    drop(listener);
    tasks.close();
    if timeout(GRACE, tasks.wait()).await.is_err() {
        stop.now.cancel();
        tasks.wait().await;
    }
}
