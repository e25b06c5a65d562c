//! Store and intake on a data directory of their own, without listeners.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;
use triplanar::config::Config;
use triplanar::error::Error;
use triplanar::intake::{Announced, Encoding, Intake, Receipt, Sender};
use triplanar::memory::Memory;
use triplanar::pipeline::Parameters;
use triplanar::store::{Outcome, SeriesRecord, SeriesState, Store};
use triplanar::telemetry::Metrics;
use uuid::Uuid;

use super::slice::Slice;

/// A store, its intake and its running timers.
pub(crate) struct Entrance {
    pub(crate) config: Config,
    pub(crate) store: Store,
    pub(crate) intake: Intake,
    timers: CancellationToken,
    task: tokio::task::JoinHandle<()>,
}

/// Settings for `data_dir`: no watermark, and no quiet time passes before a test has ended.
pub(crate) fn settings(data_dir: &Path) -> Config {
    let mut config = Config::defaults();
    config.storage.data_dir = data_dir.to_owned();
    config.storage.min_free_bytes = 0;
    config.intake.quiet = Duration::from_secs(3_600);
    config.intake.quiet_after_association = Duration::from_secs(3_600);
    config.intake.min_slices = 3;
    // These tests' series are no heads.
    config.pipeline = Parameters::paper();
    config
}

impl Entrance {
    pub(crate) async fn open(config: Config) -> Self {
        let memory = config.memory.budget();
        Self::within(config, memory).await
    }

    /// The same with a budget that others share.
    pub(crate) async fn within(config: Config, memory: Memory) -> Self {
        let store = Store::open(&config.storage).await.expect("the data directory opens");
        let (metrics, wake) = (Arc::new(Metrics::new()), Arc::new(Notify::new()));
        let intake = Intake::new(store.clone(), &config, metrics, wake, memory);
        let timers = CancellationToken::new();
        let (running, stop) = (intake.clone(), timers.clone());
        let task = tokio::spawn(async move { running.run_timers(stop).await });
        Self { config, store, intake, timers, task }
    }

    /// Stops without telling anybody, as a crash does, and opens the same directory again.
    pub(crate) async fn restart(self) -> Self {
        let config = self.config.clone();
        self.stop().await;
        Self::open(config).await
    }

    pub(crate) async fn stop(self) {
        self.timers.cancel();
        self.task.await.unwrap();
        self.store.close().await;
    }

    /// Sends a bare data set as an association would.
    pub(crate) async fn send(&self, association: Uuid, slice: &Slice) -> Result<Receipt, Error> {
        let announced = Announced {
            encoding: Encoding::DataSet(slice.syntax.parse().unwrap()),
            sop_class_uid: Some(slice.sop_class.parse().unwrap()),
            sop_instance_uid: Some(slice.sop_uid()),
            study_instance_uid: None,
            sender: Sender::Association { id: association, calling_ae_title: "TEST".into() },
        };
        self.give(&slice.data_set(), announced).await
    }

    /// Sends a file as an upload would.
    pub(crate) async fn upload(&self, upload: Uuid, file: &[u8]) -> Result<Receipt, Error> {
        let announced = Announced {
            encoding: Encoding::Part10,
            sop_class_uid: None,
            sop_instance_uid: None,
            study_instance_uid: None,
            sender: Sender::Upload { id: upload },
        };
        self.give(file, announced).await
    }

    pub(crate) async fn give(&self, bytes: &[u8], announced: Announced) -> Result<Receipt, Error> {
        let mut spool = self.intake.begin().await?;
        for part in bytes.chunks(10_000) {
            spool.write(part).await?;
        }
        self.intake.store(spool, announced).await
    }

    /// Sends `numbers` of series `series` and waits for each answer.
    pub(crate) async fn send_all(&self, association: Uuid, series: u32, numbers: std::ops::Range<u32>) {
        for number in numbers {
            self.send(association, &Slice::of(series, number)).await.expect("accepted");
        }
    }

    pub(crate) async fn series(&self, series: u32) -> SeriesRecord {
        let uid = Slice::of(series, 0).series_uid();
        self.store.series(&uid).await.unwrap().expect("the series is known")
    }

    /// Waits until the series is in that state.
    pub(crate) async fn until(&self, series: u32, state: SeriesState) -> SeriesRecord {
        for _ in 0..600 {
            let record = self.series(series).await;
            if record.state == state {
                return record;
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        panic!("series {series} did not become {state}: {:?}", self.series(series).await);
    }
}

/// A result whose cloud can be told from others.
pub(crate) fn outcome(cloud: &str) -> Outcome {
    let planes = [None, Some(triplanar::geometry::Plane::Axial), Some(triplanar::geometry::Plane::Sagittal)];
    let planes = planes.into_iter().chain([Some(triplanar::geometry::Plane::Coronal)]);
    Outcome {
        clouds: planes.map(|plane| (plane, format!("{cloud} {plane:?}").into_bytes())).collect(),
        report: format!("{{\"cloud\":\"{cloud}\"}}").into_bytes(),
        figures: triplanar::pipeline::Figures { merged: 7, ..Default::default() },
        quality: None,
        pictures: None,
    }
}
