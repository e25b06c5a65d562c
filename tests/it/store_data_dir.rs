//! The data directory: one service at a time, nothing left over, nothing kept too long.

use std::time::Duration;

use tempfile::tempdir;
use triplanar::error::Error;
use triplanar::store::{CompleteReason, OpenError, SeriesState, Store};
use uuid::Uuid;

use crate::support::entrance::{Entrance, outcome, settings};
use crate::support::slice::Slice;

const LEASE: Duration = Duration::from_secs(60);
const DAY_MS: i64 = 86_400_000;

fn now_ms() -> i64 {
    jiff::Timestamp::now().as_millisecond()
}

/// Series 1 complete, with a finished reconstruction.
async fn finished(dir: &std::path::Path) -> (Entrance, triplanar::store::ReconstructionId) {
    let entrance = Entrance::open(settings(dir)).await;
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    let uid = Slice::of(1, 0).series_uid();
    entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap();
    let claim = entrance.store.claim("w", LEASE).await.unwrap().unwrap();
    assert!(entrance.store.finish_success(&claim.lease, &outcome("a")).await.unwrap());
    (entrance, claim.lease.id)
}

fn files(dir: &std::path::Path) -> usize {
    std::fs::read_dir(dir)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| if path.is_dir() { files(&path) } else { 1 })
        .sum()
}

#[tokio::test]
async fn a_second_service_on_the_same_directory_is_refused() {
    let dir = tempdir().unwrap();
    let config = settings(dir.path());
    let first = Store::open(&config.storage).await.unwrap();
    let error = Store::open(&config.storage).await.unwrap_err();
    assert!(matches!(error, OpenError::Locked(_)), "{error:?}");
    assert!(error.to_string().contains("storage.data_dir"), "{error}");
    let ready = first.ready().await;
    assert_eq!((ready.catalog, ready.data_dir), (Ok(()), Ok(())));
    first.close().await;
    Store::open(&config.storage).await.unwrap();
}

#[tokio::test]
async fn what_has_no_row_and_can_have_none_is_set_aside_and_bounded() {
    let dir = tempdir().unwrap();
    let (entrance, id) = finished(dir.path()).await;
    let kept = files(&dir.path().join("instances")) + files(&dir.path().join("results"));
    let lost = [dir.path().join("instances/ff/lost.dcm"), dir.path().join("results/lost/1/report.json")];
    for path in &lost {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, b"x").unwrap();
    }
    let mut entrance = entrance.restart().await;
    assert!(lost.iter().all(|path| !path.exists()));
    assert_eq!(files(&dir.path().join("set-aside")), 2);
    entrance.config.storage.set_aside_bytes = 1;
    let entrance = entrance.restart().await;
    assert_eq!(files(&dir.path().join("set-aside")), 1, "beyond the limit the oldest goes");
    assert_eq!(files(&dir.path().join("instances")) + files(&dir.path().join("results")), kept);
    assert_eq!(entrance.store.cloud(id, None).await.unwrap(), b"a None");
}

#[tokio::test]
async fn removal_takes_rows_and_files() {
    let dir = tempdir().unwrap();
    let (entrance, id) = finished(dir.path()).await;
    let uid = Slice::of(1, 0).series_uid();
    assert!(entrance.store.delete_reconstruction(id).await.unwrap());
    assert!(!entrance.store.delete_reconstruction(id).await.unwrap());
    assert!(matches!(entrance.store.report(id).await, Err(Error::NotFound { .. })));
    assert_eq!(files(&dir.path().join("results")), 0);
    assert!(entrance.store.delete_series(&uid).await.unwrap());
    assert!(!entrance.store.delete_series(&uid).await.unwrap());
    assert_eq!(files(&dir.path().join("instances")), 0);
    assert!(entrance.store.series(&uid).await.unwrap().is_none());
    // What was removed can come again.
    assert!(!entrance.send(Uuid::new_v4(), &Slice::of(1, 1)).await.unwrap().duplicate);
}

#[tokio::test]
async fn sources_and_results_go_after_their_days() {
    let dir = tempdir().unwrap();
    let (entrance, id) = finished(dir.path()).await;
    entrance.send_all(Uuid::new_v4(), 2, 11..12).await;
    let uid = Slice::of(1, 0).series_uid();
    let store = &entrance.store;
    let swept = store.sweep(now_ms()).await.unwrap();
    assert_eq!((swept.series, swept.reconstructions), (0, 0));

    let swept = store.sweep(now_ms() + 31 * DAY_MS).await.unwrap();
    assert_eq!((swept.series, swept.reconstructions), (1, 0));
    assert_eq!(entrance.series(1).await.instances, 0);
    assert_eq!(entrance.series(2).await.instances, 1, "one that is receiving stays");
    assert_eq!(store.cloud(id, None).await.unwrap(), b"a None");
    let record = store.reconstruction(id).await.unwrap().unwrap();
    assert!(matches!(store.instances_of(&record).await, Err(Error::SourceRemoved)));
    let other = triplanar::pipeline::Parameters { leaf_mm: 2.0, ..record.parameters };
    assert!(matches!(store.enqueue(&uid, &other, 10).await, Err(Error::SourceRemoved)));
    assert_eq!(store.queued().await.unwrap(), 0);

    // The same instances again are the same revision and the same reconstruction.
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    let again = entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap();
    assert_eq!((again, entrance.series(1).await.revision), (Some(id), 1));
    assert_eq!(entrance.series(1).await.state, SeriesState::Complete);
    assert_eq!(store.instances_of(&record_of(&entrance, id).await).await.unwrap().len(), 4);

    let swept = store.sweep(now_ms() + 91 * DAY_MS).await.unwrap();
    assert_eq!((swept.series, swept.reconstructions), (1, 1));
    assert!(store.series(&uid).await.unwrap().is_none());
    assert_eq!(files(&dir.path().join("results")), 0);
}

async fn record_of(
    entrance: &Entrance,
    id: triplanar::store::ReconstructionId,
) -> triplanar::store::ReconstructionRecord {
    entrance.store.reconstruction(id).await.unwrap().unwrap()
}
