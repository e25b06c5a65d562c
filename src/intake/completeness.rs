//! When a series is complete: by the earliest of an explicit word, the expected number of
//! instances, the good end of its last sender and a short quiet time, a long quiet time alone.
//!
//! All of it is rows of the catalog: senders that are open, expected numbers, one deadline a
//! series. The task here only sleeps until the next deadline.

use std::time::Duration;

use tokio_util::sync::CancellationToken;
use uuid::Uuid;

use super::Intake;
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::{Error, Result};
use crate::store::{CompleteReason, Completion, End, ReconstructionId, SenderEnd, now_ms};

/// Sleep at most so long, so that a clock that is set forward is noticed.
const LONGEST_SLEEP: Duration = Duration::from_secs(5);
/// Wait after a fault of the catalog.
const AFTER_FAULT: Duration = Duration::from_secs(1);

impl Intake {
    /// The association was released, and will send nothing more: its series are complete after the
    /// short quiet time, unless others still send them.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn association_ended(&self, sender: Uuid) -> Result<()> {
        self.sender_ended(sender, SenderEnd::AssociationReleased).await
    }

    /// The same of an HTTP request that was one of many.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn request_ended(&self, sender: Uuid) -> Result<()> {
        self.sender_ended(sender, SenderEnd::UploadEnded).await
    }

    /// The sender will send nothing more. Where it did not end well, no short quiet time begins, and
    /// its series are in doubt (`incomplete_transfer`). Nor did it end well if instances of it lack.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn sender_ended(&self, sender: Uuid, end: SenderEnd) -> Result<()> {
        let ended = self.shared.senders.ended(sender, end);
        let series = self.shared.store.catalog().sender_ended(sender, &ended, &self.shared.policy).await?;
        let end = ended.end;
        self.shared.timers.notify_one();
        if end.completes().is_none() {
            warn_of_doubt(&series, end);
        }
        Ok(())
    }

    /// The upload was received whole. Completes its series and returns all of them, those included
    /// that held every instance before. A series of which an expected number is known and not
    /// reached, or that somebody else still sends, is left to wait.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn upload_ended(&self, sender: Uuid) -> Result<Vec<SeriesInstanceUid>> {
        if self.shared.senders.is_short(sender) {
            let ended = self.shared.senders.ended(sender, SenderEnd::UploadEnded);
            let catalog = self.shared.store.catalog();
            let series = catalog.sender_ended(sender, &ended, &self.shared.policy).await?;
            self.shared.timers.notify_one();
            warn_of_doubt(&series, ended.end);
            return Ok(series);
        }
        self.shared.senders.ended(sender, SenderEnd::UploadEnded);
        let ended = self.shared.store.catalog().upload_ended(sender, &self.shared.policy).await?;
        self.shared.timers.notify_one();
        Ok(ended
            .into_iter()
            .map(|(series, completion)| {
                if let Some(completion) = completion {
                    self.note_completion(&series, &completion);
                }
                series
            })
            .collect())
    }

    /// Completes a series now. Returns its reconstruction with the configured parameters; `None`
    /// if it can't be reconstructed. One that is complete already is left as it is.
    ///
    /// # Errors
    /// No such series; a full queue.
    pub async fn complete(
        &self,
        series: &SeriesInstanceUid,
        reason: CompleteReason,
    ) -> Result<Option<ReconstructionId>> {
        let completion = self.shared.store.catalog().complete(series, reason, &self.shared.policy).await?;
        let completion =
            completion.ok_or_else(|| Error::NotFound { what: "series", id: series.to_string() })?;
        self.note_completion(series, &completion);
        match completion.end {
            End::Already(id) => Ok(id),
            End::Unfit(_) => Ok(None),
            End::Reconstruction { id, .. } => Ok(Some(id)),
            End::QueueFull => Err(Error::Busy("the queue of reconstructions is full (jobs.max_queued)")),
        }
    }

    /// So many instances make the series whole; may be said before its first instance. If they are
    /// there, it is complete.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn expect(&self, series: &SeriesInstanceUid, instances: u64) -> Result<()> {
        let completion = self.shared.store.catalog().expect(series, instances, &self.shared.policy).await?;
        if let Some(completion) = completion {
            self.note_completion(series, &completion);
        }
        Ok(())
    }

    /// Completes series whose quiet time has passed, until `shutdown`. The deadlines are rows:
    /// those of a former process fire too, and its senders count as ended.
    pub async fn run_timers(&self, shutdown: CancellationToken) {
        let mut former_ended = false;
        loop {
            let sleep = match self.fire_due(&mut former_ended).await {
                Ok(sleep) => sleep,
                Err(error) => {
                    tracing::error!(%error, cause = ?error, "completing due series failed; will try again");
                    AFTER_FAULT
                }
            };
            tokio::select! {
                () = shutdown.cancelled() => return,
                () = self.shared.timers.notified() => {}
                () = tokio::time::sleep(sleep) => {}
            }
        }
    }

    /// Completes what is due; gives the time until the next deadline.
    async fn fire_due(&self, former_ended: &mut bool) -> Result<Duration> {
        let (catalog, policy) = (self.shared.store.catalog(), &self.shared.policy);
        if !*former_ended {
            warn_of_doubt(&catalog.former_senders_ended(policy).await?, SenderEnd::ServiceStopped);
            *former_ended = true;
        }
        catalog.follow_clock(policy).await?;
        for series in catalog.due().await? {
            if let Some(completion) = catalog.fire(&series, policy).await? {
                self.note_completion(&series, &completion);
            }
        }
        let next = catalog.next_due_ms().await?.map(|due| u64::try_from(due - now_ms()).unwrap_or_default());
        Ok(next.map_or(LONGEST_SLEEP, |ms| Duration::from_millis(ms).min(LONGEST_SLEEP)))
    }

    /// Logs and counts a completion, and wakes a worker for its job.
    pub(super) fn note_completion(&self, series: &SeriesInstanceUid, completion: &Completion) {
        let reason = completion.reason.name();
        match completion.end {
            End::Already(_) => return,
            End::QueueFull => {
                tracing::warn!(%series, reason, "series is complete but the queue is full; will try again");
                self.shared.timers.notify_one();
                return;
            }
            End::Unfit(unfit) => {
                tracing::info!(%series, reason, unfit = unfit.name(), "series is complete but not reconstructable");
            }
            End::Reconstruction { id, queued } => {
                tracing::info!(%series, reason, reconstruction = %id, queued, "series is complete");
                self.shared.wake.notify_one();
            }
        }
        self.shared.metrics.series_completed(completion.reason);
    }
}

fn warn_of_doubt(series: &[SeriesInstanceUid], end: SenderEnd) {
    for series in series {
        tracing::warn!(%series, sender_end = end.name(), "a sender broke off; the series may be incomplete");
    }
}
