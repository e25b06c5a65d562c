//! One attempt at a claimed reconstruction: the pipeline on its own threads, watched from here.

use std::sync::Arc;
use std::time::Duration;

use tokio::time::{MissedTickBehavior, interval};
use tokio_util::sync::CancellationToken;

use super::Shared;
use super::watch::{Stop, Watch};
use super::worker::LEASE;
use crate::error::Error;
use crate::reconstruction::{Failure, Product, RefusedInstance};
use crate::store::{Claim, Heartbeat, Refused, StoredInstances};

/// How often progress goes to the catalog, which also keeps the claim.
const HEARTBEAT: Duration = Duration::from_millis(500);

/// How an attempt ended.
#[derive(Debug)]
pub(super) enum Ended {
    /// Clouds and report, not stored yet.
    Done(Box<Product>),
    /// No cloud.
    Failed(Failure),
    /// No cloud for want of something that this process may have again later.
    Short(Failure),
    /// It was asked to stop, and did.
    Stopped(Stop),
}

impl Shared {
    /// Runs the claimed reconstruction to its end, or until it must stop.
    pub(super) async fn attempt(
        &self,
        claim: &Claim,
        watch: &Arc<Watch>,
        shutdown: &CancellationToken,
    ) -> Ended {
        let prepared = async {
            let instances = self.store.instances_of(&claim.reconstruction).await?;
            let refused = self.store.refused(&claim.reconstruction.series_instance_uid).await?;
            Ok::<_, Error>((self.store.instance_source(&instances), refused))
        };
        let (source, refused) = match prepared.await {
            Ok(prepared) => prepared,
            Err(error) => return ended_by(&error),
        };
        let stored = source.clone();
        let parameters = claim.reconstruction.parameters.clone();
        let limits = self.limits.clone();
        let (threads, observer, work) = (Arc::clone(&self.threads), Arc::clone(watch), self.work);
        let mut running = tokio::task::spawn_blocking(move || {
            threads.install(|| work(&source, &parameters, &limits, &*observer))
        });

        let mut heartbeat = interval(HEARTBEAT);
        heartbeat.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let result = loop {
            tokio::select! {
                result = &mut running => break result,
                () = shutdown.cancelled(), if watch.stopped().is_none() => watch.stop(Stop::ShuttingDown),
                _ = heartbeat.tick() => self.heartbeat(claim, watch).await,
            }
        };
        let refused = refused_instances(refused);
        match (result, watch.stopped()) {
            (Ok(Ok(mut product)), _) => {
                product.report.refused = refused;
                Ended::Done(Box::new(product))
            }
            (Ok(Err(failure)), None) if failure.code == Failure::UNREADABLE => {
                self.unreadable(claim, stored, failure).await
            }
            // Others hold the memory budget: a shortage like that of the disk.
            (Ok(Err(failure)), _) if failure.code == Failure::OUT_OF_MEMORY => Ended::Short(failure),
            (Ok(Err(failure)), Some(stop)) if failure.code == Failure::CANCELLED => Ended::Stopped(stop),
            (Ok(Err(mut failure)), _) => {
                if let Some(report) = &mut failure.report {
                    report.refused = refused;
                }
                Ended::Failed(failure)
            }
            (Err(panic), _) => {
                tracing::error!(reconstruction = %claim.lease.id, error = %panic, "the reconstruction panicked");
                Ended::Failed(passing("internal", "an internal fault; the service's log has the cause"))
            }
        }
    }

    /// Tells a shortage from instances whose bytes are gone or changed, and names all of these.
    async fn unreadable(&self, claim: &Claim, stored: StoredInstances, failure: Failure) -> Ended {
        if let Some(error) = stored.shortage() {
            return ended_by(&error);
        }
        if stored.damage().is_none() {
            return Ended::Failed(failure);
        }
        let checked = tokio::task::spawn_blocking(move || {
            stored.read_all();
            stored
        });
        match checked.await.map(|stored| stored.damage()) {
            Ok(Some(damage)) => {
                tracing::error!(
                    reconstruction = %claim.lease.id,
                    series = %claim.reconstruction.series_instance_uid,
                    code = damage.code(),
                    instances = ?damage.instances.iter().map(ToString::to_string).collect::<Vec<_>>(),
                    "stored instances are not what was acknowledged"
                );
                let lasting = passing(damage.code(), &damage.to_string());
                Ended::Failed(Failure { transient: false, instances: damage.instances, ..lasting })
            }
            _ => Ended::Failed(failure),
        }
    }

    /// Writes progress and keeps the claim; a claim that is lost stops the attempt.
    async fn heartbeat(&self, claim: &Claim, watch: &Watch) {
        let (stage, fraction) = watch.now();
        match self.store.heartbeat(&claim.lease, stage, fraction, LEASE).await {
            Ok(Heartbeat::Ours) => {}
            Ok(Heartbeat::CancelRequested) => watch.stop(Stop::Cancelled),
            Ok(Heartbeat::Lost) => watch.stop(Stop::Lost),
            Err(error) => {
                tracing::warn!(reconstruction = %claim.lease.id, error = ?error, "progress could not be written");
            }
        }
    }
}

/// What was refused at receipt, as it stands in a report.
pub(crate) fn refused_instances(refused: Vec<Refused>) -> Vec<RefusedInstance> {
    let instance = |refused: Refused| RefusedInstance {
        sop_instance_uid: refused.sop_instance_uid,
        code: refused.code,
        times: refused.times,
    };
    refused.into_iter().map(instance).collect()
}

/// How an error of the store ends an attempt: for good if the instances are gone, for later if it is
/// a shortage, as a passing fault otherwise.
pub(super) fn ended_by(error: &Error) -> Ended {
    let code = error.mapping().code.replace('-', "_");
    let transient = !matches!(error, Error::SourceRemoved);
    let failure = Failure { transient, ..passing(&code, &error.to_string()) };
    if error.is_shortage() { Ended::Short(failure) } else { Ended::Failed(failure) }
}

fn passing(code: &str, detail: &str) -> Failure {
    Failure {
        code: code.to_owned(),
        detail: detail.to_owned(),
        instances: Vec::new(),
        report: None,
        pictures: None,
        transient: true,
    }
}
