//! A worker: claims what waits, runs it, writes down what came of it.

use std::sync::Arc;
use std::time::Duration;

use tokio_util::sync::CancellationToken;

use super::Shared;
use super::conclusion::now_ms;
use super::watch::Watch;
use crate::store::{Claim, ReconstructionId};

/// How long a claim holds without a heartbeat.
pub(super) const LEASE: Duration = Duration::from_secs(30);

/// How long a worker that finds nothing waits at most before it looks again.
const IDLE: Duration = Duration::from_secs(1);

/// Works until `shutdown`.
pub(super) async fn run(shared: Arc<Shared>, name: String, shutdown: CancellationToken) {
    while !shutdown.is_cancelled() {
        match shared.store.claim(&name, LEASE).await {
            Ok(Some(claim)) => {
                // There may be more, for the next worker.
                shared.wakeup.notify_one();
                shared.work(&claim, &shutdown).await;
            }
            Ok(None) => shared.idle(&shutdown).await,
            Err(error) => {
                tracing::error!(error = ?error, "the queue can't be read");
                shared.idle(&shutdown).await;
            }
        }
    }
}

impl Shared {
    /// Until somebody enqueues, or a back-off may have passed, or the service stops.
    async fn idle(&self, shutdown: &CancellationToken) {
        let due = self.store.next_claim_ms().await.ok().flatten().map(|due| due.saturating_sub(now_ms()));
        let wait = due.and_then(|ms| u64::try_from(ms).ok()).map_or(IDLE, Duration::from_millis);
        tokio::select! {
            () = self.wakeup.notified() => {}
            () = tokio::time::sleep(wait.min(IDLE)) => {}
            () = shutdown.cancelled() => {}
        }
    }

    async fn work(&self, claim: &Claim, shutdown: &CancellationToken) {
        let reconstruction = &claim.reconstruction;
        let id = reconstruction.id;
        tracing::info!(
            reconstruction = %id,
            series = %reconstruction.series_instance_uid,
            revision = reconstruction.revision,
            attempt = reconstruction.attempts,
            "reconstruction begun"
        );
        self.metrics.job_attempted();
        let watch = Arc::new(Watch::new(
            id,
            reconstruction.parameters.profile,
            Arc::clone(&self.hub),
            Arc::clone(&self.metrics),
            self.settings.timeout,
        ));
        let _held = Held::new(self, id, Arc::clone(&watch));
        let ended = self.attempt(claim, &watch, shutdown).await;
        self.conclude(claim, &watch, ended, shutdown).await;
    }
}

/// Among what this process runs as long as this lives, a panic of the worker included.
struct Held<'a> {
    shared: &'a Shared,
    id: ReconstructionId,
}

impl<'a> Held<'a> {
    fn new(shared: &'a Shared, id: ReconstructionId, watch: Arc<Watch>) -> Self {
        shared.running().insert(id, watch);
        Self { shared, id }
    }
}

impl Drop for Held<'_> {
    fn drop(&mut self) {
        self.shared.running().remove(&self.id);
    }
}
