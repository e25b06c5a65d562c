//! What the handlers work with.

use std::sync::Arc;

use tokio_util::sync::CancellationToken;

use super::host::Hosts;
use super::upload::Uploads;
use super::volumes::Volumes;
use crate::config::Config;
use crate::crowd::Places;
use crate::intake::Intake;
use crate::jobs::Jobs;
use crate::memory::Memory;
use crate::store::Store;
use crate::telemetry::Metrics;

/// The parts of the service that HTTP is a door to.
#[derive(Debug, Clone)]
pub struct AppState {
    /// Catalog and blobs.
    pub store: Store,
    /// The way in for instances.
    pub intake: Intake,
    /// The queue.
    pub jobs: Jobs,
    /// The settings.
    pub config: Arc<Config>,
    /// What is counted.
    pub metrics: Arc<Metrics>,
}

/// [`AppState`] and what one HTTP server shares between its requests.
#[derive(Clone)]
pub(super) struct Context {
    pub(super) store: Store,
    pub(super) intake: Intake,
    pub(super) jobs: Jobs,
    pub(super) config: Arc<Config>,
    pub(super) metrics: Arc<Metrics>,
    /// Places of the uploads that may be received at a time.
    pub(super) uploads: Arc<Uploads>,
    /// Places of streams of events.
    pub(super) streams: Arc<Places>,
    /// The host names that are answered.
    pub(super) hosts: Arc<Hosts>,
    /// Volumes for slice pictures.
    pub(super) volumes: Arc<Volumes>,
    /// The budget for answers, jobs and decoding.
    pub(super) memory: Memory,
    /// Ends the streams of events.
    pub(super) shutdown: CancellationToken,
}

impl Context {
    pub(super) fn new(state: AppState, shutdown: CancellationToken) -> Self {
        let AppState { store, intake, jobs, config, metrics } = state;
        let streams = Places::new(
            config.http.max_event_streams,
            config.http.max_event_streams_per_address,
            [
                "as many streams of events as http.max_event_streams allows are open",
                "as many streams of events as http.max_event_streams_per_address allows are open",
            ],
        );
        let hosts = Arc::new(Hosts::new(&config.http));
        if hosts.is_loopback_alone() && !config.http.listen.ip().is_loopback() {
            tracing::warn!(
                "only requests for localhost and loopback addresses are answered: write the names under which \
                 clients reach the service as hosts = [\"…\"] under [http], or configure tokens"
            );
        }
        let memory = jobs.memory();
        let uploads = Uploads::new(&config.http, memory.clone());
        let volumes = Arc::new(Volumes::new(store.clone(), &config, memory.clone(), jobs.threads()));
        Self { store, intake, jobs, config, metrics, uploads, streams, hosts, volumes, memory, shutdown }
    }
}
