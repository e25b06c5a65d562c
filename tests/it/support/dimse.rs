//! The DIMSE listener and its intake alone, over a temporary data directory.

use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::Notify;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;
use triplanar::config::Config;
use triplanar::dicom::uid::SeriesInstanceUid;
use triplanar::intake::Intake;
use triplanar::store::{InstanceRecord, Store};
use triplanar::telemetry::Metrics;

/// A listener on a free port. Dropped, it stops.
pub(crate) struct Listener {
    pub(crate) address: SocketAddr,
    pub(crate) metrics: Arc<Metrics>,
    pub(crate) intake: Intake,
    store: Store,
    shutdown: CancellationToken,
    serving: Option<JoinHandle<()>>,
    runtime: tokio::runtime::Runtime,
    dir: tempfile::TempDir,
}

impl Listener {
    pub(crate) fn start(change: impl FnOnce(&mut Config)) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let mut config = Config::defaults();
        config.storage.data_dir = dir.path().to_owned();
        config.storage.min_free_bytes = 0;
        change(&mut config);
        let runtime =
            tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
        let metrics = Arc::new(Metrics::new());
        let shutdown = CancellationToken::new();
        let (store, intake, address, serving) = runtime.block_on(async {
            let store = Store::open(&config.storage).await.unwrap();
            let wake = Arc::new(Notify::new());
            let intake =
                Intake::new(store.clone(), &config, Arc::clone(&metrics), wake, config.memory.budget());
            let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
            let address = listener.local_addr().unwrap();
            let serving = tokio::spawn(triplanar::dimse::serve(
                listener,
                intake.clone(),
                config.dimse.clone(),
                Arc::clone(&metrics),
                shutdown.clone(),
            ));
            (store, intake, address, serving)
        });
        Self { address, metrics, intake, store, shutdown, serving: Some(serving), runtime, dir }
    }

    pub(crate) fn run<T>(&self, future: impl Future<Output = T>) -> T {
        self.runtime.block_on(future)
    }

    pub(crate) fn spawn(&self, future: impl Future<Output = ()> + Send + 'static) -> JoinHandle<()> {
        self.runtime.spawn(future)
    }

    /// What the catalog holds of a series.
    pub(crate) fn instances(&self, series: &str) -> Vec<InstanceRecord> {
        let series: SeriesInstanceUid = series.parse().unwrap();
        self.run(self.store.instances(&series)).unwrap()
    }

    /// The stored instances' files, and what is not whole yet.
    pub(crate) fn files(&self) -> Vec<Vec<u8>> {
        fn walk(dir: &Path, found: &mut Vec<Vec<u8>>) {
            for entry in std::fs::read_dir(dir).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    walk(&path, found);
                } else {
                    found.push(std::fs::read(path).unwrap());
                }
            }
        }
        let mut found = Vec::new();
        walk(&self.dir.path().join("instances"), &mut found);
        walk(&self.dir.path().join("incoming"), &mut found);
        found
    }

    /// Waits until a line of the metrics stands as given.
    pub(crate) fn await_metric(&self, line: &str) {
        for _ in 0..400 {
            if self.metrics.encode().lines().any(|l| l == line) {
                return;
            }
            std::thread::sleep(Duration::from_millis(25));
        }
        panic!("{line} is missing in\n{}", self.metrics.encode());
    }

    /// Begins the shutdown.
    pub(crate) fn stop(&self) {
        self.shutdown.cancel();
    }

    /// Waits until the listener has ended.
    pub(crate) fn await_end(&mut self) {
        let serving = self.serving.take().unwrap();
        self.runtime.block_on(serving).unwrap();
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        self.shutdown.cancel();
    }
}
