//! The durable queue's working side.
//!
//! The queue is rows of the catalog, not memory: intake enqueues in the transaction that completes
//! a series, [`Jobs::submit`] for a request with other parameters. A worker claims a row (which
//! counts the attempt before it begins, so that a job that kills its worker can't be tried for
//! ever), runs [`crate::reconstruction::run`] on the pipeline's own threads, keeps its claim alive,
//! and writes the results durably before the row says that it succeeded. A worker that has lost its
//! claim (somebody cancelled, or another worker took over) can no longer write anything.
//!
//! How an attempt ends:
//!
//! | what happened | the row |
//! |---|---|
//! | clouds and report are stored | `succeeded` |
//! | the series is at fault, or it shows no skin (`empty_cloud`, `no_head`, …) | `failed`, with the report if there is one |
//! | a shortage that the process survives: disk (`out_of_storage`), descriptors, memory (`out_of_memory_budget`) | `queued` after a back-off, the attempt not counted; `failed` after a day of it |
//! | a stored instance is missing or changed | `failed`, `blob_missing` or `blob_damaged` |
//! | another passing fault, a panic (`internal`) | `queued` after a back-off; `failed` after `jobs.max_attempts` |
//! | it could never fit into the budget (`too_large_for_memory`), or its parameters ask for too much (`too_costly`) | `failed` |
//! | `jobs.timeout` has passed | `failed`, `timeout` |
//! | the process died | `queued` at the next start; `failed`, `worker_died`, after `jobs.max_attempts` |
//! | the service shuts down | `queued`, the attempt not counted |
//! | somebody cancelled it | `cancelled` |

mod attempt;
mod conclusion;
mod events;
mod progress;
#[cfg(test)]
mod tests;
mod watch;
mod worker;

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::{Notify, broadcast};
use tokio_util::sync::CancellationToken;

use crate::config::{self, Config};
use crate::dicom::series::ReadLimits;
use crate::dicom::source::InstanceSource;
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::{Error, Result};
use crate::memory::Memory;
use crate::observer::Observer;
use crate::pipeline::Parameters;
use crate::reconstruction::{self, Failure, Product};
use crate::store::{Reclaim, ReconstructionId, ReconstructionRecord, ReconstructionState, Store};
use crate::telemetry::Metrics;

pub(crate) use attempt::refused_instances;
pub use events::Event;

/// The queue as the rest of the service uses it. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Jobs {
    shared: Arc<Shared>,
}

/// What an attempt runs: [`reconstruction::run`] but in tests of its failures.
type Work = fn(&dyn InstanceSource, &Parameters, &ReadLimits, &dyn Observer) -> Result<Product, Failure>;

#[derive(Debug)]
struct Shared {
    store: Store,
    settings: config::Jobs,
    /// Of the reconstructions that the service queues itself.
    own: Parameters,
    limits: ReadLimits,
    metrics: Arc<Metrics>,
    hub: Arc<events::Hub>,
    wakeup: Arc<Notify>,
    work: Work,
    /// The pipeline's threads, shared by all workers.
    threads: Arc<rayon::ThreadPool>,
    /// The attempts that run in this process.
    running: Mutex<HashMap<ReconstructionId, Arc<watch::Watch>>>,
}

impl Jobs {
    /// The queue of `store`, with the pipeline's threads; nothing runs before [`Jobs::run`].
    ///
    /// # Errors
    /// [`Error::Internal`] if the system gives no threads.
    pub fn new(store: Store, config: &Config, metrics: Arc<Metrics>) -> Result<Self> {
        Self::with_work(store, config, metrics, reconstruction::run_with_pictures)
    }

    fn with_work(store: Store, config: &Config, metrics: Arc<Metrics>, work: Work) -> Result<Self> {
        let threads = rayon::ThreadPoolBuilder::new()
            .num_threads(config.jobs.threads)
            .thread_name(|index| format!("pipeline-{index}"))
            .build()
            .map_err(Error::internal)?;
        let shared = Shared {
            store,
            settings: config.jobs.clone(),
            own: config.pipeline.clone(),
            limits: ReadLimits { memory: config.memory.budget(), ..config.read_limits() },
            metrics,
            hub: Arc::default(),
            wakeup: Arc::default(),
            work,
            threads: Arc::new(threads),
            running: Mutex::default(),
        };
        Ok(Self { shared: Arc::new(shared) })
    }

    /// Wakes a worker: whoever enqueues a row notifies it.
    #[must_use]
    pub fn wakeup(&self) -> Arc<Notify> {
        Arc::clone(&self.shared.wakeup)
    }

    /// The pipeline's threads, for what else needs them.
    pub(crate) fn threads(&self) -> Arc<rayon::ThreadPool> {
        Arc::clone(&self.shared.threads)
    }

    /// The budget of memory, for what else needs some.
    #[must_use]
    pub fn memory(&self) -> Memory {
        self.shared.limits.memory.clone()
    }

    /// Asks for a reconstruction of the latest revision of a complete series. The same parameters
    /// on the same instances are the same reconstruction: then it is given back as it stands, and
    /// the second value is `false`.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] outside a range, [`Error::NotFound`],
    /// [`Error::SeriesIncomplete`], [`Error::NotReconstructable`], [`Error::SourceRemoved`],
    /// [`Error::Busy`] when `jobs.max_queued` wait.
    pub async fn submit(
        &self,
        series: &SeriesInstanceUid,
        parameters: Parameters,
    ) -> Result<(ReconstructionRecord, bool)> {
        parameters.check().map_err(|wrong| Error::InvalidParameter {
            name: wrong.name.clone(),
            detail: wrong.to_string(),
        })?;
        let store = &self.shared.store;
        let own = parameters == self.shared.own;
        let (record, new) =
            match store.enqueue_as(series, &parameters, own, self.shared.settings.max_queued).await {
                Err(Error::NotReconstructable { uid, reason, .. }) => {
                    let detail = store.unfit_detail(series, self.shared.limits.min_slices).await?;
                    return Err(Error::NotReconstructable { uid, reason, detail });
                }
                other => other?,
            };
        if new {
            self.shared.wakeup.notify_one();
        }
        Ok((record, new))
    }

    /// Queues again what an earlier release made with a decoder at fault. The old result is served
    /// until the new one is there.
    pub(crate) async fn make_again(&self, parameters: &Parameters) {
        let store = &self.shared.store;
        let series = match store.to_make_again().await {
            Ok(series) => series,
            Err(error) => return tracing::error!(error = ?error, "what is to be made again can't be read"),
        };
        for uid in series {
            let queued = match self.submit(&uid, parameters.clone()).await {
                Ok((record, _)) => store.take_for_clinical(&record).await.map(|()| record.id),
                Err(error) => Err(error),
            };
            match queued {
                Ok(id) => tracing::warn!(series = %uid, reconstruction = %id,
                    "made again: release 0.1 could decode its JPEG Lossless wrongly"),
                Err(error) => tracing::error!(series = %uid, error = %error,
                    "release 0.1 could decode its JPEG Lossless wrongly, and it can't be made again"),
            }
        }
    }

    /// Cancels a reconstruction that waits, or asks a running one to stop. One that has ended stays
    /// as it is.
    ///
    /// # Errors
    /// [`Error::NotFound`].
    pub async fn cancel(&self, id: ReconstructionId) -> Result<ReconstructionRecord> {
        let before = self.shared.store.reconstruction(id).await?.map(|record| record.state);
        let record = self.shared.store.cancel(id).await?;
        if let Some(watch) = self.shared.running().get(&id) {
            watch.stop(watch::Stop::Cancelled);
        }
        if before == Some(ReconstructionState::Queued) && record.state == ReconstructionState::Cancelled {
            tracing::info!(reconstruction = %id, series = %record.series_instance_uid, "reconstruction cancelled");
            self.shared.metrics.job_finished(record.state);
            self.shared.tell(&record);
        }
        Ok(record)
    }

    /// Every change of a reconstruction from now on; the channel ends after a final state. Read the
    /// record after subscribing: what changed before is not told.
    #[must_use]
    pub fn subscribe(&self, id: ReconstructionId) -> broadcast::Receiver<Event> {
        self.shared.hub.subscribe(id)
    }

    /// Runs the workers until `shutdown`; a job that runs then goes back to the queue. First of
    /// all, what an earlier process was running is put back: this one holds the data directory.
    pub async fn run(&self, shutdown: CancellationToken) {
        self.shared.reclaim(Reclaim::All).await;
        let mut workers = tokio::task::JoinSet::new();
        for number in 0..self.shared.settings.workers {
            let name = format!("{}-{number}", std::process::id());
            workers.spawn(worker::run(Arc::clone(&self.shared), name, shutdown.clone()));
        }
        let mut reclaim = tokio::time::interval(worker::LEASE / 2);
        while !workers.is_empty() {
            tokio::select! {
                Some(ended) = workers.join_next() => if let Err(panic) = ended {
                    tracing::error!(error = %panic, "a worker panicked");
                    workers.spawn(worker::run(Arc::clone(&self.shared), "replacement".to_owned(), shutdown.clone()));
                },
                _ = reclaim.tick() => self.shared.reclaim(Reclaim::Expired).await,
            }
        }
    }
}

impl Shared {
    fn running(&self) -> MutexGuard<'_, HashMap<ReconstructionId, Arc<watch::Watch>>> {
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts back what has lost its worker.
    async fn reclaim(&self, which: Reclaim) {
        // What this process works on, or can't write the end of, has not lost its worker.
        let held: Vec<ReconstructionId> = self.running().keys().copied().collect();
        match self.store.reclaim(which, self.settings.max_attempts, &held).await {
            Ok(records) => records.iter().for_each(|record| {
                tracing::warn!(
                    reconstruction = %record.id,
                    series = %record.series_instance_uid,
                    attempts = record.attempts,
                    state = record.state.name(),
                    "a reconstruction had lost its worker"
                );
                if record.state.is_final() {
                    self.metrics.job_finished(record.state);
                }
                self.tell(record);
                self.wakeup.notify_one();
            }),
            Err(error) => tracing::error!(error = ?error, "lost reconstructions can't be looked for"),
        }
    }

    fn tell(&self, record: &ReconstructionRecord) {
        let (id, state, stage, fraction) = (record.id, record.state, record.stage, record.fraction);
        self.hub.publish(Event { id, state, stage, fraction });
    }
}
