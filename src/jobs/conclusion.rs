//! What is written down when an attempt has ended, as the table in [`super`] says.

use std::time::Duration;

use super::Shared;
use super::attempt::{Ended, failure_of};
use super::watch::{Stop, Watch};
use crate::error::Result;
use crate::pipeline::{Observer, Stage};
use crate::reconstruction::{Failure, Product, Report};
use crate::store::{Claim, Fault, Outcome, report_json};

/// How often writing down an end is tried before the claim is left to run out.
const TRIES: u32 = 10;

/// Pause between two tries.
const PAUSE: Duration = Duration::from_secs(1);

/// The end of an attempt that gave no result, as the queue is told.
enum End<'a> {
    /// Somebody cancelled it.
    Cancelled,
    /// As if it had not been claimed.
    Released,
    /// Again, not before that time (Unix ms).
    Retry(i64, &'a Fault),
    /// For good, with the report if there is one, and what its pictures are drawn from.
    Failed(&'a Fault, Option<Vec<u8>>, Option<Vec<u8>>),
}

impl Shared {
    pub(super) async fn conclude(&self, claim: &Claim, watch: &Watch, ended: Ended) {
        match ended {
            Ended::Done(product) => self.succeed(claim, watch, *product).await,
            Ended::Failed(failure) => self.fail(claim, failure).await,
            Ended::Stopped(Stop::TimedOut) => self.fail(claim, timed_out(self.settings.timeout)).await,
            Ended::Stopped(Stop::Cancelled) => self.end(claim, &End::Cancelled).await,
            Ended::Stopped(Stop::ShuttingDown) => self.end(claim, &End::Released).await,
            Ended::Stopped(Stop::Lost) => self.settled(claim, false).await,
        }
    }

    async fn succeed(&self, claim: &Claim, watch: &Watch, product: Product) {
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
                self.fail(claim, failure_of(&error)).await;
            }
        }
    }

    async fn fail(&self, claim: &Claim, failure: Failure) {
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
            let not_before = now_ms().saturating_add(backoff_ms(self.settings.retry_backoff, attempts));
            self.end(claim, &End::Retry(not_before, &fault)).await;
        } else {
            if let Some(report) = &failure.report {
                self.count_rejections(report);
            }
            let report = failure.report.map(|report| report_json::write(&report));
            self.end(claim, &End::Failed(&fault, report, failure.pictures)).await;
        }
    }

    /// Tries until the end is written. If nothing can be written at all, the claim runs out and the
    /// reconstruction is tried again.
    async fn end(&self, claim: &Claim, end: &End<'_>) {
        for _ in 0..TRIES {
            match self.write(claim, end).await {
                Ok(held) => return self.settled(claim, held).await,
                Err(error) => {
                    tracing::error!(reconstruction = %claim.lease.id, error = ?error, "its end can't be written");
                    tokio::time::sleep(PAUSE).await;
                }
            }
        }
        self.hub.close(claim.lease.id);
    }

    async fn write(&self, claim: &Claim, end: &End<'_>) -> Result<bool> {
        match end {
            End::Cancelled => self.store.finish_cancelled(&claim.lease).await,
            End::Released => self.store.release(&claim.lease).await,
            End::Retry(not_before, fault) => self.store.retry(&claim.lease, *not_before, fault).await,
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
fn backoff_ms(first: Duration, attempts: u32) -> i64 {
    let doublings = attempts.saturating_sub(1).min(20);
    i64::try_from(first.as_millis()).unwrap_or(i64::MAX).saturating_mul(1 << doublings)
}

pub(super) fn now_ms() -> i64 {
    jiff::Timestamp::now().as_millisecond()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_back_off_doubles_and_never_overflows() {
        let waits = [1, 2, 3, 1000].map(|attempts| backoff_ms(Duration::from_secs(5), attempts));
        assert_eq!(waits, [5_000, 10_000, 20_000, 5_000 << 20]);
        assert_eq!(backoff_ms(Duration::MAX, 3), i64::MAX);
    }
}
