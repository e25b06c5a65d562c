//! What only the job workers do: take a reconstruction, tell how far it is, end it.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use super::catalog::ResultFiles;
use super::hashed::Seal;
use super::reading::{PICTURES, REPORT, cloud_name};
use super::recovery::RECORD;
use super::stored::{figure_json, quality_json};
use super::{
    Claim, Fault, Heartbeat, Lease, Outcome, Reclaim, ReconstructionId, ReconstructionRecord, Store,
};
use super::{blocking, catalog, hashed};
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::Result;
use crate::observer::Stage;
use crate::pipeline::Parameters;

impl Store {
    /// Asks for a reconstruction of a complete series. The same instances and parameters again
    /// are the same reconstruction: one that failed or was cancelled is queued again under its id,
    /// with its attempts counted from zero, and so is one whose result is found damaged; any other is
    /// returned as it is. True if this call queued it. It waits behind clinical ones, and takes no room
    /// from them.
    ///
    /// # Errors
    /// No such series, one that is not complete or can't be reconstructed, a full queue
    /// (`max_queued`), instances that were removed.
    pub async fn enqueue(
        &self,
        uid: &SeriesInstanceUid,
        parameters: &Parameters,
        max_queued: u64,
    ) -> Result<(ReconstructionRecord, bool)> {
        self.enqueue_as(uid, parameters, false, max_queued).await
    }

    /// [`Store::enqueue`], of one that is to be a clinical one where it is the service's `own`.
    ///
    /// # Errors
    /// As [`Store::enqueue`].
    pub(crate) async fn enqueue_as(
        &self,
        uid: &SeriesInstanceUid,
        parameters: &Parameters,
        own: bool,
        max_queued: u64,
    ) -> Result<(ReconstructionRecord, bool)> {
        let (record, new) = self.0.catalog.enqueue(uid, parameters, own, max_queued).await?;
        if new || !record.state.has_cloud() {
            return Ok((record, new));
        }
        let Some(prefix) = self.damaged_result(&record).await? else { return Ok((record, false)) };
        // Without its sources it can't be made again: then what is left of it stays.
        self.instances_of(&record).await?;
        let remade = self.0.catalog.remake(record.id, &prefix, max_queued).await?;
        if remade.1 {
            tracing::warn!(reconstruction = %record.id, "its result is damaged; it is made again");
            self.remove_results(vec![prefix]).await?;
        }
        Ok(remade)
    }

    /// Takes the reconstruction that waited longest and is due, clinical ones first, and counts an attempt. `worker`
    /// stands on the row for an operator to read.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn claim(&self, worker: &str, lease: Duration) -> Result<Option<Claim>> {
        self.0.catalog.claim(worker, lease).await
    }

    /// Records progress and renews the lease. `fraction` is of the whole, 0 to 1.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn heartbeat(
        &self,
        lease: &Lease,
        stage: Stage,
        fraction: f64,
        renew_for: Duration,
    ) -> Result<Heartbeat> {
        self.0.catalog.heartbeat(lease, stage, fraction, renew_for).await
    }

    /// Stores the result, marks the reconstruction succeeded, and supersedes those of earlier
    /// revisions of the series with the same parameters. False: the lease was lost, nothing
    /// changed.
    ///
    /// # Errors
    /// A full disk, the catalog's own. The lease holds on.
    pub async fn finish_success(&self, lease: &Lease, outcome: &Outcome) -> Result<bool> {
        let figures = figure_json::write(&outcome.figures);
        let quality = outcome.quality.as_ref().map(quality_json::write);
        let mut files: Vec<(String, Vec<u8>)> =
            outcome.clouds.iter().map(|(plane, bytes)| (cloud_name(*plane), bytes.clone())).collect();
        files.push((REPORT.to_owned(), outcome.report.clone()));
        files.extend(outcome.pictures.iter().map(|pictures| (PICTURES.to_owned(), pictures.clone())));
        let result = self.write_result(lease, files).await?;
        let has_pictures = outcome.pictures.is_some();
        let ended = self.0.catalog.succeed(lease, &result, &figures, quality.as_deref(), has_pictures).await;
        self.settle(ended, Some(result.prefix)).await
    }

    /// Marks it failed, with its report if there is one. False: the lease was lost.
    ///
    /// # Errors
    /// A full disk, the catalog's own. The lease holds on.
    pub async fn finish_failure(&self, lease: &Lease, fault: &Fault, report: Option<&[u8]>) -> Result<bool> {
        self.finish_failure_with(lease, fault, report, None).await
    }

    /// The same, with what the pictures of its slices are drawn from.
    pub(crate) async fn finish_failure_with(
        &self,
        lease: &Lease,
        fault: &Fault,
        report: Option<&[u8]>,
        pictures: Option<&[u8]>,
    ) -> Result<bool> {
        let pictures = pictures.filter(|_| report.is_some());
        let result = match report {
            Some(report) => {
                let mut files = vec![(REPORT.to_owned(), report.to_owned())];
                files.extend(pictures.map(|pictures| (PICTURES.to_owned(), pictures.to_owned())));
                Some(self.write_result(lease, files).await?)
            }
            None => None,
        };
        let ended = self.0.catalog.fail(lease, fault, result.as_ref(), pictures.is_some()).await;
        self.settle(ended, result.map(|result| result.prefix)).await
    }

    /// Writes the record beside the result, then commits. A result that has no row after that is
    /// removed: another attempt makes it again.
    async fn settle(&self, ended: Result<Option<catalog::Ended>>, prefix: Option<String>) -> Result<bool> {
        let settled = match ended {
            Ok(Some(ended)) => self.commit(ended, prefix.as_deref()).await.map(|()| true),
            Ok(None) => Ok(false),
            Err(error) => Err(error),
        };
        if !matches!(settled, Ok(true))
            && let Some(prefix) = prefix
            && !self.0.catalog.names_result(&prefix).await.unwrap_or(true)
        {
            self.remove_results(vec![prefix]).await?;
        }
        settled
    }

    async fn commit(&self, ended: catalog::Ended, prefix: Option<&str>) -> Result<()> {
        if let Some(prefix) = prefix {
            let (store, key) = (Arc::clone(&self.0.blobs), format!("{prefix}/{RECORD}"));
            let record = ended.record.to_json()?;
            blocking(move || Ok(hashed::put(&*store, &key, &record)?)).await?;
        }
        Ok(ended.tx.commit().await?)
    }

    /// Marks it cancelled, as somebody asked. False: the lease was lost.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn finish_cancelled(&self, lease: &Lease) -> Result<bool> {
        self.0.catalog.finish_cancelled(lease).await
    }

    /// Queues it again, to be claimed after `wait`; the fault stands on the row until it ends.
    /// The caller has checked that attempts are left. If somebody asked to cancel it, it is
    /// cancelled instead. False: the lease was lost.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn retry(&self, lease: &Lease, wait: Duration, fault: &Fault) -> Result<bool> {
        self.0.catalog.retry(lease, wait, fault).await
    }

    /// Puts it back because of a shortage that this process survives: the attempt is not counted. It
    /// waits for `waits.0` at first, longer the longer this goes on, at most `waits.1`. Once it has
    /// been put back for `patience`, it has failed with that fault. False: the lease was lost.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn defer(
        &self,
        lease: &Lease,
        waits: (Duration, Duration),
        patience: Duration,
        fault: &Fault,
    ) -> Result<bool> {
        self.0.catalog.defer(lease, waits, patience, fault).await
    }

    /// Gives it back as if it had not been claimed (shutting down). False: the lease was lost.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn release(&self, lease: &Lease) -> Result<bool> {
        self.0.catalog.release(lease).await
    }

    /// Cancels: a queued one at once, a running one at its next heartbeat, a final one not at all.
    /// Returns it as it is then.
    ///
    /// # Errors
    /// No such reconstruction.
    pub async fn cancel(&self, id: ReconstructionId) -> Result<ReconstructionRecord> {
        self.0.catalog.cancel(id).await
    }

    /// Queues again what lost its worker, but for what this process still holds (`held`); one without attempts left has failed with `worker_died`,
    /// one that was to be cancelled is cancelled. Returns those that changed, as they are now.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn reclaim(
        &self,
        which: Reclaim,
        max_attempts: u32,
        held: &[ReconstructionId],
    ) -> Result<Vec<ReconstructionRecord>> {
        self.0.catalog.reclaim(which, max_attempts, held).await
    }

    /// When the next queued reconstruction may be claimed, Unix ms; `None` if none is queued.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn next_claim_ms(&self) -> Result<Option<i64>> {
        self.0.catalog.next_claim_ms().await
    }

    /// How many reconstructions are queued.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn queued(&self) -> Result<u64> {
        self.0.catalog.queued().await
    }

    /// Makes the files of a result durable, each with the hashes of its blocks. Each lease writes to a place
    /// of its own: one that was lost can't touch what its successor wrote.
    async fn write_result(&self, lease: &Lease, files: Vec<(String, Vec<u8>)>) -> Result<ResultFiles> {
        let prefix = format!("results/{}/{}", lease.id, lease.fence);
        let (store, folder) = (Arc::clone(&self.0.blobs), prefix.clone());
        let seal = blocking(move || {
            let mut seal = Seal::default();
            let mut put = |(name, bytes): (String, Vec<u8>)| {
                let hash = hashed::put(&*store, &format!("{folder}/{name}"), &bytes)?;
                seal.add(name, hash);
                Ok::<_, io::Error>(())
            };
            let written = files.into_iter().try_for_each(&mut put);
            if written.is_err() {
                // Half a result takes the room that the next attempt needs.
                let _the_first_error_is_told = store.remove_all(&folder);
            }
            written?;
            Ok(seal)
        })
        .await?;
        Ok(ResultFiles { prefix, seal: Some(seal) })
    }
}
