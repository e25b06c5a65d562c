//! What is written down when an attempt has ended, as the table in [`super`] says.

use std::time::Duration;

use tokio_util::sync::CancellationToken;

use super::Shared;
use super::attempt::{Ended, ended_by};
use super::watch::{Stop, Watch};
use crate::error::Result;
use crate::observer::{Observer, Stage};
use crate::reconstruction::{Failure, Product, Report};
use crate::store::{Claim, Fault, Outcome, report_json};

/// Pause between two tries to write down an end.
const PAUSE: Duration = Duration::from_secs(1);

/// Longest wait of what was put back for a shortage.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// So long a shortage is waited for.
const PATIENCE: Duration = Duration::from_secs(24 * 3600);

/// The end of an attempt that gave no result, as the queue is told.
enum End<'a> {
    /// Somebody cancelled it.
    Cancelled,
    /// As if it had not been claimed.
    Released,
    /// Again, after that time.
    Retry(Duration, &'a Fault),
    /// Again, as if it had not been claimed, when there may be enough of what was short.
    Deferred(&'a Fault),
    /// For good, with the report if there is one, and what its pictures are drawn from.
    Failed(&'a Fault, Option<Vec<u8>>, Option<Vec<u8>>),
}

impl Shared {
    pub(super) async fn conclude(
        &self,
        claim: &Claim,
        watch: &Watch,
        ended: Ended,
        shutdown: &CancellationToken,
    ) {
        match ended {
            Ended::Done(product) => self.succeed(claim, watch, *product, shutdown).await,
            Ended::Failed(failure) => self.fail(claim, failure, shutdown).await,
            Ended::Short(failure) => self.defer(claim, failure, shutdown).await,
            Ended::Stopped(Stop::TimedOut) => {
                self.fail(claim, timed_out(self.settings.timeout), shutdown).await;
            }
            Ended::Stopped(Stop::Cancelled) => self.end(claim, &End::Cancelled, shutdown).await,
            Ended::Stopped(Stop::ShuttingDown) => self.end(claim, &End::Released, shutdown).await,
            Ended::Stopped(Stop::Lost) => self.settled(claim, false).await,
        }
    }

    async fn succeed(&self, claim: &Claim, watch: &Watch, product: Product, shutdown: &CancellationToken) {
        watch.progress(Stage::Writing, 0.0);
        let outcome = Outcome {
            report: report_json::write(&product.report),
            figures: product.report.figures.clone(),
            quality: product.report.quality.clone(),
            clouds: product.clouds.into(),
            pictures: product.pictures,
        };
        match self.store.finish_success(&claim.lease, &outcome).await {
            Ok(held) => {
                watch.ended();
                self.count_rejections(&product.report);
                if let Some(quality) = &product.report.quality {
                    self.metrics.verdict_reached(quality.verdict);
                }
                self.settled(claim, held).await;
            }
            Err(error) => {
                tracing::error!(reconstruction = %claim.lease.id, error = ?error, "the result can't be stored");
                match ended_by(&error) {
                    Ended::Short(failure) => self.defer(claim, failure, shutdown).await,
                    Ended::Failed(failure) => self.fail(claim, failure, shutdown).await,
                    Ended::Done(_) | Ended::Stopped(_) => {}
                }
            }
        }
    }

    /// Puts it back, its attempt not counted.
    async fn defer(&self, claim: &Claim, failure: Failure, shutdown: &CancellationToken) {
        tracing::warn!(
            reconstruction = %claim.lease.id,
            series = %claim.reconstruction.series_instance_uid,
            code = failure.code,
            detail = failure.detail,
            "reconstruction put back until there is enough again; the attempt does not count"
        );
        let fault = Fault { code: failure.code, detail: failure.detail, instances: failure.instances };
        self.end(claim, &End::Deferred(&fault), shutdown).await;
    }

    async fn fail(&self, claim: &Claim, failure: Failure, shutdown: &CancellationToken) {
        let attempts = claim.reconstruction.attempts;
        let again = failure.transient && attempts < self.settings.max_attempts;
        tracing::warn!(
            reconstruction = %claim.lease.id,
            series = %claim.reconstruction.series_instance_uid,
            attempt = attempts,
            code = failure.code,
            detail = failure.detail,
            tried_again = again,
            "reconstruction failed"
        );
        let fault = Fault { code: failure.code, detail: failure.detail, instances: failure.instances };
        if again {
            let wait = backoff(self.settings.retry_backoff, attempts);
            self.end(claim, &End::Retry(wait, &fault), shutdown).await;
        } else {
            if let Some(report) = &failure.report {
                self.count_rejections(report);
            }
            let report = failure.report.map(|report| report_json::write(&report));
            self.end(claim, &End::Failed(&fault, report, failure.pictures), shutdown).await;
        }
    }

    /// Tries until the end is written: as long as this process lives it holds on to the claim, and
    /// what it can't write costs no attempt. At a stop it tries once more; the next start takes up
    /// what is left.
    async fn end(&self, claim: &Claim, end: &End<'_>, shutdown: &CancellationToken) {
        loop {
            let last = shutdown.is_cancelled();
            match self.write(claim, end).await {
                Ok(held) => return self.settled(claim, held).await,
                Err(error) => {
                    tracing::error!(reconstruction = %claim.lease.id, error = ?error, "its end can't be written");
                    if last {
                        break;
                    }
                    tokio::select! {
                        () = tokio::time::sleep(PAUSE) => {}
                        () = shutdown.cancelled() => {}
                    }
                }
            }
        }
        self.hub.close(claim.lease.id);
    }

    async fn write(&self, claim: &Claim, end: &End<'_>) -> Result<bool> {
        match end {
            End::Cancelled => self.store.finish_cancelled(&claim.lease).await,
            End::Released => self.store.release(&claim.lease).await,
            End::Retry(wait, fault) => self.store.retry(&claim.lease, *wait, fault).await,
            End::Deferred(fault) => {
                let waits = (self.settings.retry_backoff.min(LONGEST_WAIT), LONGEST_WAIT);
                self.store.defer(&claim.lease, waits, PATIENCE, fault).await
            }
            End::Failed(fault, report, pictures) => {
                self.store
                    .finish_failure_with(&claim.lease, fault, report.as_deref(), pictures.as_deref())
                    .await
            }
        }
    }

    /// Tells log, metrics and subscribers how it ended: as the row says, which may say `cancelled`
    /// where it was to be queued again.
    async fn settled(&self, claim: &Claim, held: bool) {
        let id = claim.lease.id;
        let series = &claim.reconstruction.series_instance_uid;
        let row = self.store.reconstruction(id).await;
        match row {
            Ok(Some(record)) if held => {
                tracing::info!(reconstruction = %id, %series, state = record.state.name(), "attempt ended");
                if record.state.is_final() {
                    self.metrics.job_finished(record.state);
                }
                self.tell(&record);
            }
            Ok(_) => {
                tracing::warn!(reconstruction = %id, %series, "the claim was lost; the attempt's end is dropped");
                self.hub.close(id);
            }
            Err(error) => {
                tracing::error!(reconstruction = %id, %series, error = ?error, "its row can't be read");
                self.hub.close(id);
            }
        }
    }

    fn count_rejections(&self, report: &Report) {
        for summary in &report.planes {
            for (reason, &slices) in &summary.rejected {
                self.metrics.slices_rejected(summary.plane, reason, slices);
            }
        }
    }
}

fn timed_out(timeout: Duration) -> Failure {
    Failure {
        code: "timeout".to_owned(),
        detail: format!(
            "not finished within {} s; raise jobs.timeout, or give it more cores",
            timeout.as_secs_f64()
        ),
        instances: Vec::new(),
        report: None,
        pictures: None,
        transient: false,
    }
}

/// The wait after attempt `attempts`: doubled for each one after the first.
fn backoff(first: Duration, attempts: u32) -> Duration {
    first.saturating_mul(1 << attempts.saturating_sub(1).min(20))
}

pub(super) fn now_ms() -> i64 {
    jiff::Timestamp::now().as_millisecond()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_back_off_doubles_and_never_overflows() {
        let waits = [1, 2, 3, 1000].map(|attempts| backoff(Duration::from_secs(5), attempts).as_secs());
        assert_eq!(waits, [5, 10, 20, 5 << 20]);
        assert_eq!(backoff(Duration::MAX, 3), Duration::MAX);
    }
}
