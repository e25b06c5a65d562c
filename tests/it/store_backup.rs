//! A catalog that was brought back from a backup: corrections that came after it are in files alone, and are
//! not lost.

use std::fs;
use std::path::Path;

use tempfile::tempdir;
use triplanar::config::Config;
use triplanar::store::{CompleteReason, Rebuilt, Store, TransferDoubt};
use uuid::Uuid;

use crate::support::entrance::{Entrance, outcome, settings};
use crate::support::slice::Slice;

const SLICES: std::ops::Range<u32> = 1..6;

/// A complete series with its result, as the backup knows it; then `corrected` of it come. The backup is in
/// the catalog's place afterwards.
async fn restored(data: &Path, corrected: impl Fn(u32) -> Vec<Slice>) -> Config {
    let entrance = Entrance::open(settings(data)).await;
    let uid = Slice::of(1, 0).series_uid();
    entrance.send_all(Uuid::new_v4(), 1, SLICES).await;
    entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap();
    let claim = entrance.store.claim("w", std::time::Duration::from_secs(60)).await.unwrap().unwrap();
    assert!(entrance.store.finish_success(&claim.lease, &outcome("cloud")).await.unwrap());
    entrance.stop().await;
    let backup = fs::read(data.join("catalog.sqlite")).unwrap();

    let entrance = Entrance::open(settings(data)).await;
    for number in SLICES {
        for slice in corrected(number) {
            entrance.send(Uuid::new_v4(), &slice).await.unwrap();
        }
    }
    let config = entrance.config.clone();
    entrance.stop().await;
    for name in ["catalog.sqlite-wal", "catalog.sqlite-shm"] {
        let _may_be_gone = fs::remove_file(data.join(name));
    }
    fs::write(data.join("catalog.sqlite"), backup).unwrap();
    config
}

fn files(folder: &Path) -> usize {
    let folders = fs::read_dir(folder).into_iter().flatten();
    folders.map(|shard| fs::read_dir(shard.unwrap().path()).unwrap().count()).sum()
}

/// What `check` finds.
async fn problems(config: &Config) -> usize {
    Store::check(&config.storage).await.unwrap().problems.len()
}

async fn rebuilt(config: &Config) -> Rebuilt {
    Store::rebuild(&config.storage, true).await.unwrap()
}

fn of_another(number: u32) -> Slice {
    Slice { patient_id: "PATIENT-0815", ..Slice::of(1, number) }
}

#[tokio::test]
async fn a_corrected_identity_is_entered_from_the_files() {
    let dir = tempdir().unwrap();
    // Twice: the latest counts.
    let twice =
        |number| vec![Slice { patient_id: "PATIENT-0001", ..Slice::of(1, number) }, of_another(number)];
    let config = restored(dir.path(), twice).await;
    let entrance = Entrance::open(config.clone()).await;
    let series = entrance.series(1).await;
    assert_eq!((series.patient_id.as_deref(), series.identity_changing), (Some("PATIENT-0815"), false));
    assert_eq!((series.doubts, series.instances, series.revision), (vec![], 5, 1));
    assert_eq!(
        (files(&dir.path().join("instances")), files(&dir.path().join("set-aside/instances"))),
        (5, 0)
    );
    let uid = Slice::of(1, 0).series_uid();
    assert!(entrance.store.clinical(&uid).await.unwrap().is_some(), "it is of the same images");
    assert!(entrance.send(Uuid::new_v4(), &of_another(2)).await.unwrap().duplicate);
    entrance.stop().await;
    assert_eq!(problems(&config).await, 0);
    let told = rebuilt(&config).await;
    assert_eq!((told.blobs.instances, told.blobs.set_aside.len()), (5, 0), "{told:#?}");
    let series = Entrance::open(config).await.series(1).await;
    assert_eq!((series.patient_id.as_deref(), series.doubts), (Some("PATIENT-0815"), vec![]));
}

#[tokio::test]
async fn a_correction_of_some_is_still_under_way() {
    let dir = tempdir().unwrap();
    let some = |number| if number < 3 { vec![of_another(number)] } else { Vec::new() };
    let config = restored(dir.path(), some).await;
    let entrance = Entrance::open(config).await;
    assert!(entrance.series(1).await.identity_changing, "no cloud under two names");
    for number in 3..6 {
        entrance.send(Uuid::new_v4(), &of_another(number)).await.unwrap();
    }
    let series = entrance.series(1).await;
    assert_eq!((series.patient_id.as_deref(), series.identity_changing), (Some("PATIENT-0815"), false));
}

#[tokio::test]
async fn other_corrected_attributes_are_entered_as_one_correction() {
    let dir = tempdir().unwrap();
    let corrected = |number| vec![Slice { comments: "corrected", ..Slice::of(1, number) }];
    let config = restored(dir.path(), corrected).await;
    let entrance = Entrance::open(config.clone()).await;
    let uid = Slice::of(1, 0).series_uid();
    let changes = entrance.store.attribute_changes(&uid).await.unwrap();
    assert_eq!(changes.iter().map(|change| change.instances).collect::<Vec<_>>(), [5]);
    assert!(entrance.send(Uuid::new_v4(), &corrected(1)[0]).await.unwrap().duplicate);
    entrance.stop().await;
    assert_eq!((problems(&config).await, files(&dir.path().join("set-aside/instances"))), (0, 0));
}

#[tokio::test]
async fn an_image_that_took_the_place_of_a_removed_one_is_set_aside_and_the_series_in_doubt() {
    let dir = tempdir().unwrap();
    let config = restored(dir.path(), |_| Vec::new()).await;
    let other = tempdir().unwrap();
    let stranger = Entrance::open(settings(other.path())).await;
    stranger.send(Uuid::new_v4(), &Slice { value: 99, ..Slice::of(1, 1) }).await.unwrap();
    stranger.stop().await;
    // Its UID is that of the first slice, whose file is gone.
    let of_first = format!("{}.", Slice::of(1, 1).sop_uid());
    let file = |root: &Path| {
        let shards = fs::read_dir(root.join("instances")).unwrap();
        let mut all = shards.flat_map(|shard| fs::read_dir(shard.unwrap().path()).unwrap());
        all.find_map(|file| {
            let path = file.unwrap().path();
            path.file_name()?.to_str()?.starts_with(&of_first).then_some(path)
        })
        .expect("a file of the first slice")
    };
    let (lost, found) = (file(dir.path()), file(other.path()));
    fs::copy(&found, lost.with_file_name(found.file_name().unwrap())).unwrap();
    fs::remove_file(lost).unwrap();
    let entrance = Entrance::open(config).await;
    let series = entrance.series(1).await;
    assert_eq!((series.doubts, series.instances), (vec![TransferDoubt::IncompleteTransfer], 5));
    assert_eq!(files(&dir.path().join("set-aside/instances")), 1);
}
