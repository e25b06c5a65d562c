//! The table in [`super`], row by row, over a real store.

use std::thread::sleep;
use std::time::{Duration, Instant};

use uuid::Uuid;

use super::*;
use crate::intake::{Announced, Encoding, Intake, Sender};
use crate::observer::Stage;
use crate::phantom::{Options, Phantom};
use crate::store::CompleteReason;

/// A store with one complete series, whose reconstruction waits.
struct Fixture {
    jobs: Jobs,
    store: Store,
    id: ReconstructionId,
    shutdown: CancellationToken,
    _dir: tempfile::TempDir,
}

impl Fixture {
    async fn new(work: Work, change: impl FnOnce(&mut Config)) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let mut config = Config::defaults();
        config.storage.data_dir = dir.path().to_owned();
        config.storage.min_free_bytes = 0;
        config.jobs.retry_backoff = Duration::from_millis(1);
        config.jobs.threads = 1;
        change(&mut config);
        let metrics = Arc::new(Metrics::new());
        let store = Store::open(&config.storage).await.unwrap();
        let jobs = Jobs::with_work(store.clone(), &config, Arc::clone(&metrics), work).unwrap();
        let intake = Intake::new(store.clone(), &config, metrics, jobs.wakeup(), jobs.memory());
        let options = Options { columns: 32, rows: 32, slices: 12, ..Options::default() };
        let phantom = Phantom::new(options).unwrap();
        for (_, bytes) in phantom.instances() {
            let mut spool = intake.begin().await.unwrap();
            spool.write(&bytes).await.unwrap();
            let sender = Sender::Upload { id: Uuid::nil() };
            let announced = Announced {
                encoding: Encoding::Part10,
                sop_class_uid: None,
                sop_instance_uid: None,
                study_instance_uid: None,
                sender,
            };
            intake.store(spool, announced).await.unwrap();
        }
        let series = phantom.identity().series_instance_uid;
        let id = intake.complete(&series, CompleteReason::Explicit).await.unwrap().unwrap();
        Self { jobs, store, id, shutdown: CancellationToken::new(), _dir: dir }
    }

    fn run(&self) -> tokio::task::JoinHandle<()> {
        let (jobs, shutdown) = (self.jobs.clone(), self.shutdown.clone());
        tokio::spawn(async move { jobs.run(shutdown).await })
    }

    async fn record(&self) -> ReconstructionRecord {
        self.store.reconstruction(self.id).await.unwrap().unwrap()
    }

    /// Runs the workers until the reconstruction has ended.
    async fn ended(&self) -> ReconstructionRecord {
        let workers = self.run();
        let begin = Instant::now();
        while !self.record().await.state.is_final() {
            assert!(begin.elapsed() < Duration::from_secs(60), "{:?}", self.record().await);
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        self.shutdown.cancel();
        workers.await.unwrap();
        self.record().await
    }

    async fn until_running(&self) {
        while self.record().await.state != ReconstructionState::Running {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }
}

fn failure(code: &str, transient: bool) -> Failure {
    Failure {
        code: code.to_owned(),
        detail: "as the test wants it".to_owned(),
        instances: Vec::new(),
        report: None,
        pictures: None,
        transient,
    }
}

/// Work that goes on until it is told to stop.
fn endless(
    _: &dyn InstanceSource,
    _: &Parameters,
    _: &ReadLimits,
    observer: &dyn Observer,
) -> Result<Product, Failure> {
    observer.progress(Stage::Axial, 0.5);
    while !observer.cancelled() {
        sleep(Duration::from_millis(1));
    }
    Err(failure(Failure::CANCELLED, false))
}

#[tokio::test]
async fn a_passing_fault_is_tried_again_and_fails_after_the_last_attempt() {
    let fixture = Fixture::new(|_, _, _, _| Err(failure("unreadable_source", true)), |_| {}).await;
    let record = fixture.ended().await;
    assert_eq!(record.state, ReconstructionState::Failed);
    assert_eq!((record.error_code.as_deref(), record.attempts), (Some("unreadable_source"), 3));
}

#[tokio::test]
async fn what_lies_in_the_series_is_not_tried_again() {
    let fixture = Fixture::new(|_, _, _, _| Err(failure("missing_slice", false)), |_| {}).await;
    let record = fixture.ended().await;
    assert_eq!(record.state, ReconstructionState::Failed);
    assert_eq!((record.error_code.as_deref(), record.attempts), (Some("missing_slice"), 1));
}

#[tokio::test]
async fn a_panic_counts_as_an_attempt_and_the_worker_lives() {
    let fixture = Fixture::new(|_, _, _, _| panic!("as the test wants it"), |_| {}).await;
    let record = fixture.ended().await;
    assert_eq!(record.state, ReconstructionState::Failed);
    assert_eq!((record.error_code.as_deref(), record.attempts), (Some("internal"), 3));
    assert!(!record.error_detail.unwrap().contains("as the test wants it"), "the cause is for the log alone");
}

#[tokio::test]
async fn a_job_that_runs_too_long_has_failed_with_timeout() {
    let fixture = Fixture::new(endless, |config| config.jobs.timeout = Duration::from_millis(50)).await;
    let record = fixture.ended().await;
    assert_eq!(record.state, ReconstructionState::Failed);
    assert_eq!((record.error_code.as_deref(), record.attempts), (Some("timeout"), 1));
}

#[tokio::test]
async fn a_running_job_that_is_cancelled_stops_and_its_events_end() {
    let fixture = Fixture::new(endless, |_| {}).await;
    let mut events = fixture.jobs.subscribe(fixture.id);
    let workers = fixture.run();
    fixture.until_running().await;
    fixture.jobs.cancel(fixture.id).await.unwrap();
    let mut told = Vec::new();
    while let Ok(event) = events.recv().await {
        told.push(event.state);
    }
    assert_eq!(told.last(), Some(&ReconstructionState::Cancelled), "{told:?}");
    assert_eq!(fixture.record().await.state, ReconstructionState::Cancelled);
    fixture.shutdown.cancel();
    workers.await.unwrap();
}

#[tokio::test]
async fn a_waiting_job_that_is_cancelled_never_runs() {
    let fixture = Fixture::new(|_, _, _, _| unreachable!("it was cancelled"), |_| {}).await;
    let record = fixture.jobs.cancel(fixture.id).await.unwrap();
    assert_eq!(record.state, ReconstructionState::Cancelled);
    assert_eq!(fixture.ended().await.attempts, 0);
}

#[tokio::test]
async fn a_removed_job_stops() {
    let fixture = Fixture::new(endless, |_| {}).await;
    let mut events = fixture.jobs.subscribe(fixture.id);
    let workers = fixture.run();
    fixture.until_running().await;
    assert!(fixture.store.delete_reconstruction(fixture.id).await.unwrap());
    while events.recv().await.is_ok() {}
    fixture.shutdown.cancel();
    workers.await.unwrap();
}

#[tokio::test]
async fn a_shutdown_puts_the_job_back_and_does_not_count_the_attempt() {
    let fixture = Fixture::new(endless, |_| {}).await;
    let workers = fixture.run();
    fixture.until_running().await;
    fixture.shutdown.cancel();
    workers.await.unwrap();
    let record = fixture.record().await;
    assert_eq!((record.state, record.attempts), (ReconstructionState::Queued, 0));
}

#[tokio::test]
async fn the_same_parameters_are_the_same_reconstruction() {
    let fixture = Fixture::new(endless, |_| {}).await;
    let series = fixture.record().await.series_instance_uid;
    let (same, new) = fixture.jobs.submit(&series, Parameters::default()).await.unwrap();
    assert_eq!((same.id, new), (fixture.id, false));
    let finer = Parameters { leaf_mm: 0.38, ..Parameters::default() };
    let (other, new) = fixture.jobs.submit(&series, finer).await.unwrap();
    assert!(new && other.id != fixture.id);
    let wrong = Parameters { leaf_mm: -1.0, ..Parameters::default() };
    assert!(matches!(fixture.jobs.submit(&series, wrong).await, Err(Error::InvalidParameter { .. })));
}

#[tokio::test]
async fn a_full_queue_is_told() {
    let fixture = Fixture::new(endless, |config| config.jobs.max_queued = 1).await;
    let series = fixture.record().await.series_instance_uid;
    let finer = Parameters { leaf_mm: 0.38, ..Parameters::default() };
    assert!(matches!(fixture.jobs.submit(&series, finer).await, Err(Error::Busy(_))));
}
