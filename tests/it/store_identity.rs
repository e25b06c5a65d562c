//! What a result is made by, after an upgrade; rows that another version wrote.

use std::path::Path;
use std::time::Duration;

use serde_json::{Value, json};
use sqlx::Connection as _;
use tempfile::tempdir;
use triplanar::pipeline::Parameters;
use triplanar::store::{CompleteReason, ReconstructionFilter, ReconstructionState, SeriesFilter};
use uuid::Uuid;

use crate::support::entrance::{Entrance, outcome, settings};
use crate::support::http::{Server, problem};
use crate::support::slice::Slice;

const LEASE: Duration = Duration::from_secs(60);

/// Changes rows behind the service's back.
async fn alter(data_dir: &Path, statement: &'static str) {
    let file = data_dir.join("catalog.sqlite");
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(file);
    let mut connection = sqlx::SqliteConnection::connect_with(&options).await.unwrap();
    let done = sqlx::query(statement).execute(&mut connection).await.unwrap();
    assert!(done.rows_affected() > 0, "{statement}");
    connection.close().await.unwrap();
}

#[tokio::test]
async fn after_a_new_version_of_the_algorithm_the_old_result_is_served_and_asking_again_makes_another() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    let uid = Slice::of(1, 0).series_uid();
    let old = entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap().unwrap();
    let claim = entrance.store.claim("w", LEASE).await.unwrap().unwrap();
    assert_eq!(claim.reconstruction.algorithm, "paper/1");
    assert!(entrance.store.finish_success(&claim.lease, &outcome("old")).await.unwrap());
    // As if an earlier version of the algorithm had made it: its hash is of both.
    entrance.stop().await;
    alter(dir.path(), "UPDATE reconstructions SET algorithm = 'paper/0', parameters_sha256 = zeroblob(32)")
        .await;
    let entrance = Entrance::open(settings(dir.path())).await;
    assert_eq!(entrance.store.queued().await.unwrap(), 0, "nothing is made again by itself");
    assert_eq!(entrance.store.cloud(old, None).await.unwrap(), b"old None");
    let (new, queued) = entrance.store.enqueue(&uid, &entrance.config.pipeline, 10).await.unwrap();
    assert!(queued && new.id != old);
    assert_eq!(new.algorithm, "paper/1");
    let claim = entrance.store.claim("w", LEASE).await.unwrap().unwrap();
    assert!(entrance.store.finish_success(&claim.lease, &outcome("new")).await.unwrap());
    let kept = entrance.store.reconstruction(old).await.unwrap().unwrap();
    assert_eq!((kept.state, kept.algorithm.as_str()), (ReconstructionState::Succeeded, "paper/0"));
    assert_eq!(entrance.store.cloud(old, None).await.unwrap(), b"old None");
    let (again, queued) = entrance.store.enqueue(&uid, &entrance.config.pipeline, 10).await.unwrap();
    assert_eq!((again.id, queued), (new.id, false));
    // A later revision takes the place of both.
    entrance.send_all(Uuid::new_v4(), 1, 5..6).await;
    let latest = entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap().unwrap();
    let claim = entrance.store.claim("w", LEASE).await.unwrap().unwrap();
    assert!(entrance.store.finish_success(&claim.lease, &outcome("latest")).await.unwrap());
    for earlier in [old, new.id] {
        let record = entrance.store.reconstruction(earlier).await.unwrap().unwrap();
        assert_eq!(record.superseded_by, Some(latest));
    }
}

#[tokio::test]
async fn what_0_1_made_of_lossless_jpeg_is_made_again_when_it_is_asked_for() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    let uid = Slice::of(1, 0).series_uid();
    let old = entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap().unwrap();
    let claim = entrance.store.claim("w", LEASE).await.unwrap().unwrap();
    assert!(entrance.store.finish_success(&claim.lease, &outcome("old")).await.unwrap());
    entrance.stop().await;
    // As 0.1 left it, whose rows name no algorithm.
    alter(dir.path(), "UPDATE reconstructions SET algorithm = NULL").await;
    alter(dir.path(), "UPDATE instances SET transfer_syntax_uid = '1.2.840.10008.1.2.4.70'").await;
    let entrance = Entrance::open(settings(dir.path())).await;
    let kept = entrance.store.reconstruction(old).await.unwrap().unwrap();
    assert_eq!((kept.state, kept.algorithm.as_str()), (ReconstructionState::Succeeded, "paper/0"));
    assert_eq!(entrance.store.cloud(old, None).await.unwrap(), b"old None");
    assert_eq!(entrance.store.to_make_again().await.unwrap(), std::slice::from_ref(&uid));
    let (new, queued) = entrance.store.enqueue(&uid, &entrance.config.pipeline, 10).await.unwrap();
    assert!(queued && new.id != old);
    assert_eq!(new.algorithm, "paper/1");
    entrance.store.take_for_clinical(&new).await.unwrap();
    assert!(entrance.store.to_make_again().await.unwrap().is_empty());
    let clinical = || async { entrance.store.clinical(&uid).await.unwrap().unwrap().reconstruction.id };
    assert_eq!(clinical().await, old, "until the new one is there");
    let claim = entrance.store.claim("w", LEASE).await.unwrap().unwrap();
    assert!(entrance.store.finish_success(&claim.lease, &outcome("new")).await.unwrap());
    assert_eq!(clinical().await, new.id);
    entrance.stop().await;
    let entrance = Entrance::open(settings(dir.path())).await;
    let (again, queued) = entrance.store.enqueue(&uid, &entrance.config.pipeline, 10).await.unwrap();
    assert_eq!((again.id, queued), (new.id, false), "once");
}

#[tokio::test]
async fn what_still_waits_after_an_upgrade_is_run_by_the_new_version_under_its_id() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    let uid = Slice::of(1, 0).series_uid();
    let id = entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap().unwrap();
    entrance.stop().await;
    alter(
        dir.path(),
        "UPDATE reconstructions SET algorithm = 'paper/0', parameters_sha256 = zeroblob(32), software = 'old'",
    )
    .await;
    let entrance = Entrance::open(settings(dir.path())).await;
    let (same, queued) = entrance.store.enqueue(&uid, &entrance.config.pipeline, 10).await.unwrap();
    assert_eq!((same.id, queued, same.algorithm.as_str()), (id, false, "paper/1"));
    assert_eq!(same.software, triplanar::SOFTWARE);
}

#[tokio::test]
async fn parameters_without_an_effect_make_no_other_reconstruction() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    let uid = Slice::of(1, 0).series_uid();
    entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap();
    let precise = Parameters::precise();
    let (first, queued) = entrance.store.enqueue(&uid, &precise, 10).await.unwrap();
    assert!(queued);
    let other = Parameters { hu_min: -300, ..precise };
    let (second, queued) = entrance.store.enqueue(&uid, &other, 10).await.unwrap();
    assert_eq!((second.id, queued), (first.id, false));
}

#[tokio::test]
async fn a_row_of_a_later_version_is_told_by_its_id_and_hides_no_other() {
    let server = Server::start().await;
    let (uid, newer) = server.succeeded(1).await;
    let (_, other) = server.succeeded(2).await;
    let path = server.config.storage.data_dir.clone();
    alter(
        &path,
        "UPDATE reconstructions SET parameters = replace(parameters, '\"schema\":1', '\"schema\":99') \
         WHERE id = (SELECT MIN(id) FROM reconstructions)",
    )
    .await;
    let list: Value = server.get("/v1/reconstructions").send().await.unwrap().json().await.unwrap();
    assert_eq!(list["items"].as_array().unwrap().len(), 1, "{list:#}");
    assert_eq!(list["items"][0]["id"], json!(other.to_string()));
    assert_eq!(list["unreadable"][0]["id"], json!(newer.to_string()));
    let detail = list["unreadable"][0]["detail"].as_str().unwrap();
    assert!(detail.contains("schema 99"), "{detail}");
    let one = server.get(&format!("/v1/reconstructions/{newer}")).send().await.unwrap();
    let told = problem(one, 500, "unreadable").await;
    assert!(told["detail"].as_str().unwrap().contains(&newer.to_string()), "{told:#}");
    assert_eq!(server.get(&format!("/v1/series/{uid}")).send().await.unwrap().status(), 200);

    // A name that only a later version knows, in a series' row.
    alter(
        &path,
        "UPDATE series SET complete_reason = 'telepathy' WHERE created_ms = (SELECT MIN(created_ms) FROM series)",
    )
    .await;
    let list = server.store.list_series(&SeriesFilter::default(), None, 10).await.unwrap();
    assert_eq!((list.rows.len(), list.unreadable.len()), (1, 1));
    assert!(list.unreadable[0].detail.contains("telepathy"), "{list:?}");
    let list: Value = server.get("/v1/series?limit=1").send().await.unwrap().json().await.unwrap();
    let cursor = list["next_cursor"].as_str().expect("another page");
    let next: Value = server
        .get(&format!("/v1/series?limit=1&cursor={cursor}"))
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    assert_eq!(next["unreadable"][0]["id"], json!(uid.as_str()), "{next:#}");
}

#[tokio::test]
async fn a_job_of_a_later_version_fails_by_name_and_keeps_no_other_waiting() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    for series in 1..=2 {
        entrance.send_all(Uuid::new_v4(), series, series * 10..series * 10 + 4).await;
        let uid = Slice::of(series, 0).series_uid();
        entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap();
    }
    alter(
        dir.path(),
        "UPDATE reconstructions SET parameters = '{\"schema\":99}' WHERE id = (SELECT MIN(id) FROM reconstructions)",
    )
    .await;
    assert!(entrance.store.claim("w", LEASE).await.is_err());
    let next = entrance.store.claim("w", LEASE).await.unwrap().expect("the other one");
    assert_eq!(next.reconstruction.series_instance_uid, Slice::of(2, 0).series_uid());
    let all = entrance.store.list_reconstructions(&ReconstructionFilter::default(), None, 10).await.unwrap();
    assert_eq!((all.rows.len(), all.unreadable.len()), (1, 1));
    assert_eq!(entrance.store.queued().await.unwrap(), 0);
}
