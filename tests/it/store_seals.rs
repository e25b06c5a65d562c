//! The files of a result are tied to its row and to its record: what lost its hashes, or took another
//! file's place with its hashes, is noticed by whoever reads it, by `check` and by `rebuild`.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use tempfile::tempdir;
use triplanar::config::Config;
use triplanar::error::Error;
use triplanar::pipeline::Parameters;
use triplanar::store::{CompleteReason, Rebuilt, ReconstructionId, Store};
use uuid::Uuid;

use crate::support::entrance::{Entrance, outcome, settings};
use crate::support::slice::Slice;

const LEASE: Duration = Duration::from_secs(60);

/// A series with two results, whose clouds say `first` and `other`, and no service on it any more.
async fn made(dir: &Path) -> (Config, [ReconstructionId; 2]) {
    let entrance = Entrance::open(settings(dir)).await;
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    let uid = Slice::of(1, 0).series_uid();
    let first = entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap().unwrap();
    let other = Parameters { leaf_mm: 2.0, ..entrance.config.pipeline.clone() };
    let other = entrance.store.enqueue(&uid, &other, 10).await.unwrap().0.id;
    for cloud in ["first", "other"] {
        let claim = entrance.store.claim("w", LEASE).await.unwrap().unwrap();
        assert!(entrance.store.finish_success(&claim.lease, &outcome(cloud)).await.unwrap());
    }
    let config = entrance.config.clone();
    entrance.stop().await;
    (config, [first, other])
}

/// The folder of a result.
fn folder(config: &Config, id: ReconstructionId) -> PathBuf {
    let fences = config.storage.data_dir.join("results").join(id.to_string());
    fs::read_dir(fences).expect("fences").next().expect("one").expect("an entry").path()
}

/// Kind and file name of what `check` finds.
async fn checked(config: &Config) -> Vec<(String, String)> {
    let checked = Store::check(&config.storage).await.expect("it can be checked");
    let name = |path: &str| path.rsplit('/').next().expect("a name").to_owned();
    checked.problems.iter().map(|problem| (problem.kind.to_owned(), name(&problem.path))).collect()
}

/// Which of these clouds are served; the others must be told as damaged.
async fn served(config: &Config, ids: &[ReconstructionId]) -> Vec<bool> {
    let entrance = Entrance::open(config.clone()).await;
    let mut served = Vec::new();
    for id in ids {
        served.push(match entrance.store.cloud(*id, None).await {
            Ok(_) => true,
            Err(Error::ResultDamaged { .. }) => false,
            Err(error) => panic!("{error}"),
        });
    }
    entrance.stop().await;
    served
}

async fn rebuilt(config: &Config) -> Rebuilt {
    Store::rebuild(&config.storage, true).await.expect("it is made again")
}

#[tokio::test]
async fn a_result_that_lost_all_its_hashes_is_not_taken_for_one_of_a_release_without_any() {
    let dir = tempdir().unwrap();
    let (config, ids) = made(dir.path()).await;
    let result = folder(&config, ids[0]);
    for file in fs::read_dir(&result).unwrap() {
        let path = file.unwrap().path();
        if path.extension().is_some_and(|end| end == "blocks") && !path.ends_with("record.json.blocks") {
            fs::remove_file(path).unwrap();
        }
    }
    let mut cloud = fs::read(result.join("triplanar.ply")).unwrap();
    cloud[3] ^= 1;
    fs::write(result.join("triplanar.ply"), cloud).unwrap();
    assert_eq!(served(&config, &ids).await, [false, true]);
    let found = checked(&config).await;
    let names = ["axial.ply", "coronal.ply", "report.json", "sagittal.ply", "triplanar.ply"];
    assert_eq!(found, names.map(|name| ("damaged".to_owned(), name.to_owned())));
    let told = rebuilt(&config).await;
    assert_eq!((told.reconstructions, told.blobs.damaged_results.len()), (2, 5), "{told:#?}");
    assert_eq!(served(&config, &ids).await, [false, true]);
    assert_eq!(checked(&config).await, found);
}

#[tokio::test]
async fn a_file_that_took_another_ones_place_with_its_hashes_is_noticed() {
    let dir = tempdir().unwrap();
    let (config, ids) = made(dir.path()).await;
    let (first, other) = (folder(&config, ids[0]), folder(&config, ids[1]));
    let kept = dir.path().join("kept");
    fs::create_dir(&kept).unwrap();
    for end in ["", ".blocks"] {
        let name = format!("triplanar.ply{end}");
        fs::copy(first.join(&name), kept.join(&name)).unwrap();
        fs::copy(first.join(format!("axial.ply{end}")), first.join(&name)).unwrap();
    }
    let damaged = |name: &str| ("damaged".to_owned(), name.to_owned());
    assert_eq!(served(&config, &ids).await, [false, true]);
    assert_eq!(checked(&config).await, [damaged("triplanar.ply")]);
    // Two results' clouds exchanged.
    for end in ["", ".blocks"] {
        let name = format!("triplanar.ply{end}");
        fs::copy(other.join(&name), first.join(&name)).unwrap();
        fs::copy(kept.join(&name), other.join(&name)).unwrap();
    }
    assert_eq!(served(&config, &ids).await, [false, false]);
    assert_eq!(checked(&config).await, [damaged("triplanar.ply"), damaged("triplanar.ply")]);
    let told = rebuilt(&config).await;
    assert_eq!((told.reconstructions, told.blobs.damaged_results.len()), (2, 2), "{told:#?}");
    assert_eq!(served(&config, &ids).await, [false, false]);
}

#[tokio::test]
async fn two_results_exchanged_with_all_that_lies_beside_them_are_noticed() {
    let dir = tempdir().unwrap();
    let (config, ids) = made(dir.path()).await;
    let (first, other) = (folder(&config, ids[0]), folder(&config, ids[1]));
    let away = dir.path().join("away");
    fs::rename(&first, &away).unwrap();
    fs::rename(&other, &first).unwrap();
    fs::rename(&away, &other).unwrap();
    assert_eq!(served(&config, &ids).await, [false, false]);
    let found = checked(&config).await;
    assert_eq!(found.iter().filter(|problem| problem.1 == "triplanar.ply").count(), 2, "{found:?}");
    assert_eq!(found.iter().filter(|problem| problem.1 == "record.json").count(), 2, "{found:?}");
    let told = rebuilt(&config).await;
    assert_eq!(told.reconstructions, 0, "{told:#?}");
    assert!(told.blobs.set_aside.iter().all(|blob| blob.reason.contains("another result")), "{told:#?}");
}

#[tokio::test]
async fn a_record_that_is_gone_or_changed_is_noticed() {
    let dir = tempdir().unwrap();
    let (config, ids) = made(dir.path()).await;
    fs::remove_file(folder(&config, ids[0]).join("record.json")).unwrap();
    let changed = folder(&config, ids[1]).join("record.json");
    let text = fs::read_to_string(&changed).unwrap();
    fs::write(&changed, text.replacen("\"revision\": 1", "\"revision\": 7", 1)).unwrap();
    let mut found = checked(&config).await;
    found.sort();
    assert_eq!(found, ["damaged", "missing"].map(|kind| (kind.to_owned(), "record.json".to_owned())));
    assert_eq!(served(&config, &ids).await, [true, true], "the clouds are what they were");
    let told = rebuilt(&config).await;
    assert_eq!(told.reconstructions, 0, "nothing is entered on the word of a damaged record: {told:#?}");
    let reasons: Vec<_> = told.blobs.set_aside.iter().map(|blob| blob.reason.as_str()).collect();
    for part in ["no record", "its record is damaged"] {
        assert!(reasons.iter().any(|reason| reason.contains(part)), "{reasons:?}");
    }
}
