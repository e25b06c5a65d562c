//! `triplanar rebuild`: what comes back column by column, and what is in doubt afterwards.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use sqlx::{AssertSqlSafe, Connection as _};
use tempfile::tempdir;
use triplanar::config::Config;
use triplanar::pipeline::Parameters;
use triplanar::store::{
    CompleteReason, Rebuilt, ReconstructionId, SenderEnd, SeriesState, Store, TransferDoubt,
};
use uuid::Uuid;

use crate::support::entrance::{Entrance, outcome, settings};
use crate::support::service::{run, triplanar};
use crate::support::slice::Slice;

const LEASE: Duration = Duration::from_secs(60);

async fn connection(data_dir: &Path) -> sqlx::SqliteConnection {
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(data_dir.join("catalog.sqlite"));
    sqlx::SqliteConnection::connect_with(&options.foreign_keys(true)).await.unwrap()
}

/// Every row of a table, column by column, as SQL literals, in the order of the first column.
async fn rows(data_dir: &Path, table: &str, but: &[&str]) -> Vec<BTreeMap<String, String>> {
    let mut connection = connection(data_dir).await;
    let names: Vec<String> = sqlx::query_scalar("SELECT name FROM pragma_table_info($1) ORDER BY cid")
        .bind(table)
        .fetch_all(&mut connection)
        .await
        .unwrap();
    let mut rows = Vec::new();
    for name in names.iter().filter(|name| !but.contains(&name.as_str())) {
        let statement = format!("SELECT quote({name}) FROM {table} ORDER BY {}", names[0]);
        let column: Vec<String> =
            sqlx::query_scalar(AssertSqlSafe(statement)).fetch_all(&mut connection).await.unwrap();
        rows.resize_with(column.len(), BTreeMap::new);
        for (row, value) in rows.iter_mut().zip(column) {
            row.insert(name.clone(), value);
        }
    }
    connection.close().await.unwrap();
    rows
}

/// Four slices of series 1, complete, with its own reconstruction and another one.
async fn made(entrance: &Entrance) -> (ReconstructionId, ReconstructionId) {
    let (sender, uid) = (Uuid::new_v4(), Slice::of(1, 0).series_uid());
    entrance.send_all(sender, 1, 1..5).await;
    entrance.intake.sender_ended(sender, SenderEnd::AssociationAborted).await.unwrap();
    entrance.intake.expect(&uid, 7).await.unwrap();
    let own = entrance.intake.complete(&uid, CompleteReason::Quiet).await.unwrap().unwrap();
    finish(entrance).await;
    let other = Parameters { leaf_mm: 2.0, ..entrance.config.pipeline.clone() };
    let other = entrance.store.enqueue(&uid, &other, 10).await.unwrap().0.id;
    finish(entrance).await;
    (own, other)
}

async fn finish(entrance: &Entrance) {
    let claim = entrance.store.claim("w", LEASE).await.unwrap().unwrap();
    assert!(entrance.store.finish_success(&claim.lease, &outcome("cloud")).await.unwrap());
}

/// Loses the catalog and makes it again.
async fn rebuilt(config: &Config) -> Rebuilt {
    std::fs::remove_file(config.storage.data_dir.join("catalog.sqlite")).unwrap();
    let rebuilt = Store::rebuild(&config.storage, false).await.unwrap();
    assert!(rebuilt.blobs.set_aside.is_empty() && rebuilt.blobs.unread_choices.is_empty(), "{rebuilt:#?}");
    rebuilt
}

#[tokio::test]
async fn every_column_of_series_instances_reconstructions_and_choices_comes_back() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let (own, other) = made(&entrance).await;
    let (config, uid) = (entrance.config.clone(), Slice::of(1, 0).series_uid());
    for choice in [Some(other), None, Some(other)] {
        entrance.store.choose_clinical(&uid, choice, Some("operator")).await.unwrap();
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
    // Another attribute of two instances, before the last result was stored.
    for number in 1..3 {
        let corrected = Slice { comments: "corrected", ..Slice::of(1, number) };
        entrance.send(Uuid::new_v4(), &corrected).await.unwrap();
    }
    let third = Parameters { leaf_mm: 3.0, ..entrance.config.pipeline.clone() };
    entrance.store.enqueue(&uid, &third, 10).await.unwrap();
    finish(&entrance).await;
    // A corrected identity of every instance: the set, and so the reconstructions, stay the same.
    for number in 1..5 {
        let corrected = Slice { patient_id: "PATIENT-0815", ..Slice::of(1, number) };
        entrance.send(Uuid::new_v4(), &corrected).await.unwrap();
    }
    entrance.stop().await;
    let tables: [(&str, &[&str]); 6] = [
        ("reconstructions", &[]),
        // When it came is when its file was written; rounds of identity count from the last one.
        ("instances", &["received_ms", "identity_round"]),
        ("series", &["created_ms", "updated_ms", "identity_round"]),
        ("clinical_choices", &[]),
        ("expectations", &["set_ms"]),
        ("attribute_changes", &[]),
    ];
    let mut before = Vec::new();
    for (table, but) in tables {
        before.push(rows(dir.path(), table, but).await);
    }
    assert_eq!(before.iter().map(Vec::len).collect::<Vec<_>>(), [3, 4, 1, 3, 1, 1]);
    assert_ne!(before[1][0]["image_sha256"], "NULL");
    assert_eq!(
        (&*before[2][0]["incomplete_transfer"], &*before[2][0]["patient_id"]),
        ("1", "'PATIENT-0815'")
    );

    let told = rebuilt(&config).await;
    for lost in ["identities were corrected", "other attributes were corrected", "refusals of instances"] {
        assert!(told.lost.iter().any(|told| told.contains(lost)), "{lost}: {told:#?}");
    }
    for ((table, but), before) in tables.into_iter().zip(before) {
        assert_eq!(rows(dir.path(), table, but).await, before, "{table}");
    }
    let entrance = Entrance::open(config).await;
    let clinical = entrance.store.clinical(&uid).await.unwrap().unwrap();
    assert_eq!((clinical.reconstruction.id, clinical.chosen), (other, true));
    let (same, queued) = entrance.store.enqueue(&uid, &entrance.config.pipeline, 10).await.unwrap();
    assert_eq!((same.id, queued), (own, false), "what was made of the corrected set is found");
}

#[tokio::test]
async fn one_that_was_chosen_before_is_not_taken_for_chosen_when_the_other_is_removed() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let (own, first) = made(&entrance).await;
    let uid = Slice::of(1, 0).series_uid();
    let second = Parameters { leaf_mm: 3.0, ..entrance.config.pipeline.clone() };
    let second = entrance.store.enqueue(&uid, &second, 10).await.unwrap().0.id;
    finish(&entrance).await;
    for id in [first, second] {
        entrance.store.choose_clinical(&uid, Some(id), None).await.unwrap();
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
    assert!(entrance.store.delete_reconstruction(second).await.unwrap());
    let clinical = entrance.store.clinical(&uid).await.unwrap().unwrap();
    assert_eq!((clinical.reconstruction.id, clinical.chosen), (own, false));
    let config = entrance.config.clone();
    entrance.stop().await;
    rebuilt(&config).await;
    let entrance = Entrance::open(config).await;
    let clinical = entrance.store.clinical(&uid).await.unwrap().unwrap();
    assert_eq!((clinical.reconstruction.id, clinical.chosen), (own, false));
}

#[tokio::test]
async fn a_change_of_identity_that_was_under_way_still_is() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    made(&entrance).await;
    let corrected = |number| Slice { patient_id: "PATIENT-0815", ..Slice::of(1, number) };
    for number in 1..3 {
        entrance.send(Uuid::new_v4(), &corrected(number)).await.unwrap();
    }
    assert!(entrance.series(1).await.identity_changing);
    let config = entrance.config.clone();
    entrance.stop().await;
    rebuilt(&config).await;
    let entrance = Entrance::open(config).await;
    assert!(entrance.series(1).await.identity_changing, "no cloud under two names");
    for number in 3..5 {
        entrance.send(Uuid::new_v4(), &corrected(number)).await.unwrap();
    }
    let series = entrance.series(1).await;
    assert_eq!((series.identity_changing, series.patient_id.as_deref()), (false, Some("PATIENT-0815")));
}

#[tokio::test]
async fn a_series_of_which_a_file_was_entered_at_start_is_in_doubt() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let uid = Slice::of(1, 0).series_uid();
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap();
    assert!(entrance.series(1).await.doubts.is_empty());
    let config = entrance.config.clone();
    entrance.stop().await;
    // As a crash between file and row leaves it.
    let mut connection = connection(dir.path()).await;
    let gone = sqlx::query("DELETE FROM instances WHERE sop_uid = $1")
        .bind(Slice::of(1, 4).sop_uid().to_string())
        .execute(&mut connection)
        .await
        .unwrap();
    assert_eq!(gone.rows_affected(), 1);
    connection.close().await.unwrap();
    let entrance = Entrance::open(config).await;
    let series = entrance.series(1).await;
    assert_eq!(series.state, SeriesState::Receiving);
    assert_eq!(series.doubts, [TransferDoubt::IncompleteTransfer], "nobody said that it is whole");
}

#[tokio::test]
async fn a_series_without_a_result_of_all_its_instances_is_in_doubt() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let uid = Slice::of(1, 0).series_uid();
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap();
    finish(&entrance).await;
    entrance.send_all(Uuid::new_v4(), 1, 5..6).await;
    entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap();
    let config = entrance.config.clone();
    entrance.stop().await;
    rebuilt(&config).await;
    let entrance = Entrance::open(config).await;
    let series = entrance.series(1).await;
    assert_eq!((series.state, series.revision), (SeriesState::Receiving, 1));
    assert_eq!(series.doubts, [TransferDoubt::IncompleteTransfer]);
}

#[tokio::test]
async fn an_experiment_does_not_become_the_clinical_one() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let uid = Slice::of(1, 0).series_uid();
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    let own = entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap().unwrap();
    entrance.store.cancel(own).await.unwrap();
    let other = Parameters { leaf_mm: 2.0, ..entrance.config.pipeline.clone() };
    entrance.store.enqueue(&uid, &other, 10).await.unwrap();
    finish(&entrance).await;
    assert_eq!(entrance.store.clinical(&uid).await.unwrap(), None);
    let config = entrance.config.clone();
    entrance.stop().await;
    rebuilt(&config).await;
    let entrance = Entrance::open(config).await;
    assert_eq!(entrance.store.clinical(&uid).await.unwrap(), None);
    let series = entrance.series(1).await;
    assert_eq!(series.state, SeriesState::Receiving, "its own one is made after the quiet time");
    assert_eq!(series.doubts, [], "it was completed by word");
}

#[tokio::test]
async fn a_file_that_changed_is_not_entered_and_the_good_one_can_be_sent_again() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let uid = Slice::of(1, 0).series_uid();
    entrance.send_all(Uuid::new_v4(), 1, 1..7).await;
    entrance.send(Uuid::new_v4(), &Slice { patient_id: "PATIENT-0815", ..Slice::of(1, 6) }).await.unwrap();
    for number in 1..6 {
        let corrected = Slice { patient_id: "PATIENT-0815", ..Slice::of(1, number) };
        entrance.send(Uuid::new_v4(), &corrected).await.unwrap();
    }
    entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap();
    finish(&entrance).await;
    let config = entrance.config.clone();
    entrance.stop().await;
    // One bit of a pixel, of the name of the instance in the file's header, of the hash of the first image.
    let harms: [fn(&[u8]) -> usize; 3] = [
        |file| file.len() - 5,
        |file| 144 + file[144..].windows(4).position(|part| part == b"\x02\0\x03\0").expect("a UID") + 30,
        |file| 144 + file[144..].windows(4).position(|part| part == b"\x02\0\x02\x01").expect("hashes") + 50,
    ];
    let mut files = Vec::new();
    for shard in std::fs::read_dir(dir.path().join("instances")).unwrap() {
        files.extend(std::fs::read_dir(shard.unwrap().path()).unwrap().map(|file| file.unwrap().path()));
    }
    files.sort_by_key(|path| path.file_name().unwrap().to_owned());
    assert_eq!(files.len(), 6);
    for (path, place) in files.iter().zip(harms) {
        let mut bytes = std::fs::read(path).unwrap();
        let place = place(&bytes);
        bytes[place] ^= 1;
        std::fs::write(path, bytes).unwrap();
    }
    std::fs::remove_file(dir.path().join("catalog.sqlite")).unwrap();
    let told = Store::rebuild(&config.storage, false).await.unwrap();
    let reasons: Vec<_> = told.blobs.set_aside.iter().map(|blob| blob.reason.as_str()).collect();
    assert_eq!(reasons.len(), 3, "{told:#?}");
    assert!(reasons.iter().all(|reason| reason.contains("send this instance again")), "{reasons:?}");
    assert_eq!((told.blobs.instances, told.blobs.unsealed_instances), (3, 0));
    let entrance = Entrance::open(config).await;
    let series = entrance.series(1).await;
    assert_eq!((series.state, series.instances), (SeriesState::Receiving, 3));
    assert_eq!(series.doubts, [TransferDoubt::IncompleteTransfer]);
    for number in 1..4 {
        let corrected = Slice { patient_id: "PATIENT-0815", ..Slice::of(1, number) };
        assert!(!entrance.send(Uuid::new_v4(), &corrected).await.unwrap().duplicate);
    }
    assert_eq!(entrance.series(1).await.instances, 6);
}

#[tokio::test]
async fn a_refusal_that_was_held_still_is() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let uid = Slice::of(1, 0).series_uid();
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    let other_pixels = Slice { value: 41, ..Slice::of(1, 2) };
    entrance.send(Uuid::new_v4(), &other_pixels).await.expect_err("refused");
    entrance.intake.complete(&uid, CompleteReason::Quiet).await.unwrap();
    finish(&entrance).await;
    let before = (entrance.series(1).await.doubts, entrance.store.refused(&uid).await.unwrap());
    assert_eq!(before.0, [TransferDoubt::InstancesRefused]);
    assert_eq!(before.1.len(), 1);
    let config = entrance.config.clone();
    entrance.stop().await;
    rebuilt(&config).await;
    let entrance = Entrance::open(config).await;
    assert_eq!((entrance.series(1).await.doubts, entrance.store.refused(&uid).await.unwrap()), before);
}

#[tokio::test]
async fn an_instance_that_a_result_was_made_from_and_no_file_holds_is_named() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    made(&entrance).await;
    let config = entrance.config.clone();
    entrance.stop().await;
    let uids: Vec<String> = [2, 3].map(|number| Slice::of(1, number).sop_uid().to_string()).into();
    for shard in std::fs::read_dir(dir.path().join("instances")).unwrap() {
        for file in std::fs::read_dir(shard.unwrap().path()).unwrap() {
            let path = file.unwrap().path();
            let name = path.file_name().unwrap().to_str().unwrap().to_owned();
            if uids.iter().any(|uid| name.starts_with(&format!("{uid}."))) {
                std::fs::remove_file(path).unwrap();
            }
        }
    }
    std::fs::remove_file(dir.path().join("catalog.sqlite")).unwrap();
    let mut command = triplanar();
    command.args(["rebuild", "--json", "--data-dir"]).arg(dir.path());
    let told: serde_json::Value = serde_json::from_slice(&run(command).stdout).expect("JSON");
    let series = Slice::of(1, 0).series_uid().to_string();
    let expected = serde_json::json!([{ "series_instance_uid": series, "stored": 2, "lost": uids }]);
    assert_eq!(told["missing_instances"], expected, "{told:#}");
    let mut command = triplanar();
    command.args(["rebuild", "--replace", "--data-dir"]).arg(dir.path());
    let text = String::from_utf8(run(command).stdout).unwrap();
    assert!(text.contains(&format!("send them again: of series {series} 2 ")), "{text}");
    assert!(uids.iter().all(|uid| text.contains(uid)), "{text}");
    let series = Entrance::open(config).await.series(1).await;
    assert!(series.doubts.contains(&TransferDoubt::IncompleteTransfer), "{:?}", series.doubts);
}
