//! What a full catalog, a crash and a clock leave behind, made inside the store.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use tokio::sync::Notify;
use uuid::Uuid;

use super::*;
use crate::config::Config;
use crate::dicom::uid::SeriesInstanceUid;
use crate::intake::{Announced, Encoding, Intake, Sender};
use crate::phantom::{Options, Phantom};
use crate::telemetry::Metrics;

/// Four instances of one series, sent once.
struct Fixture {
    config: Config,
    store: Store,
    intake: Intake,
    files: Vec<Vec<u8>>,
    series: SeriesInstanceUid,
    dir: tempfile::TempDir,
}

impl Fixture {
    async fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let mut config = Config::defaults();
        config.storage.data_dir = dir.path().to_owned();
        config.storage.min_free_bytes = 0;
        config.intake.min_slices = 2;
        let store = Store::open(&config.storage).await.unwrap();
        let intake = Intake::new(
            store.clone(),
            &config,
            Arc::new(Metrics::new()),
            Arc::new(Notify::new()),
            config.memory.budget(),
        );
        let phantom =
            Phantom::new(Options { columns: 32, rows: 32, slices: 4, ..Options::default() }).unwrap();
        let files = phantom.instances().into_iter().map(|(_, bytes)| bytes).collect();
        let series = phantom.identity().series_instance_uid;
        let fixture = Self { config, store, intake, files, series, dir };
        for index in 0..4 {
            fixture.send(index).await.unwrap();
        }
        fixture
    }

    /// Sends an instance; whether it was a duplicate.
    async fn send(&self, index: usize) -> Result<bool> {
        let mut spool = self.intake.begin().await?;
        spool.write(&self.files[index]).await?;
        let announced = Announced {
            encoding: Encoding::Part10,
            sop_class_uid: None,
            sop_instance_uid: None,
            study_instance_uid: None,
            sender: Sender::Upload { id: Uuid::nil() },
        };
        Ok(self.intake.store(spool, announced).await?.duplicate)
    }

    /// Another process opens the directory.
    async fn reopened(&self) -> Store {
        self.store.close().await;
        Store::open(&self.config.storage).await.unwrap()
    }

    fn blobs(&self) -> Vec<String> {
        blobs::keys_under(self.dir.path(), vec![self.dir.path().join("instances")]).unwrap()
    }

    async fn run(&self, sql: &'static str) {
        let mut tx = self.store.catalog().begin().await.unwrap();
        sqlx::query(sql).execute(&mut *tx).await.unwrap();
        tx.commit().await.unwrap();
    }
}

#[tokio::test]
async fn after_a_full_catalog_the_next_change_goes_through() {
    let fixture = Fixture::new().await;
    let catalog = fixture.store.catalog();
    // SQLite's own limit for this connection: the next page that is needed is refused.
    let mut limited = catalog.begin().await.unwrap();
    let pages: i64 = sqlx::query_scalar("PRAGMA page_count").fetch_one(&mut *limited).await.unwrap();
    let limit = sqlx::AssertSqlSafe(format!("PRAGMA max_page_count = {pages}"));
    sqlx::query(limit).execute(&mut *limited).await.unwrap();
    limited.commit().await.unwrap();

    let mut tx = catalog.begin().await.unwrap();
    let mut refused = None;
    for number in 0..10_000 {
        let row = sqlx::query("INSERT INTO removed_blobs (blob) VALUES ($1)")
            .bind(format!("instances/00/{number:0200}"))
            .execute(&mut *tx)
            .await;
        if let Err(error) = row {
            refused = Some(Error::from(error));
            break;
        }
    }
    assert!(matches!(refused, Some(Error::OutOfStorage)), "{refused:?}");
    drop(tx);
    catalog.try_write().await.unwrap();
    assert!(fixture.send(0).await.unwrap(), "a duplicate writes that its sender was heard");
    assert!(catalog.removed_blobs().await.unwrap().blobs.is_empty(), "nothing of it was kept");
}

#[tokio::test]
async fn a_change_that_is_given_up_half_way_leaves_nothing() {
    let fixture = Fixture::new().await;
    let catalog = fixture.store.catalog().clone();
    for _ in 0..20 {
        let changing = async {
            let mut tx = catalog.begin().await.unwrap();
            sqlx::query("DELETE FROM instances").execute(&mut *tx).await.unwrap();
            std::future::pending::<()>().await;
        };
        let soon = std::time::Duration::from_millis(3);
        assert!(tokio::time::timeout(soon, changing).await.is_err());
    }
    assert_eq!(fixture.store.instances(&fixture.series).await.unwrap().len(), 4);
    catalog.try_write().await.unwrap();
}

#[tokio::test]
async fn what_was_deleted_does_not_come_back_after_a_crash() {
    let fixture = Fixture::new().await;
    // The rows go; the process dies before the files do.
    fixture.store.catalog().delete_series(&fixture.series).await.unwrap().unwrap();
    assert_eq!(fixture.blobs().len(), 4);
    let store = fixture.reopened().await;
    assert!(store.series(&fixture.series).await.unwrap().is_none());
    assert!(fixture.blobs().is_empty());
}

#[tokio::test]
async fn a_durable_file_without_its_row_is_entered() {
    let fixture = Fixture::new().await;
    fixture.run("DELETE FROM instances WHERE sop_uid = (SELECT MAX(sop_uid) FROM instances)").await;
    fixture.run("UPDATE series SET instances = 3").await;
    let store = fixture.reopened().await;
    assert_eq!(store.instances(&fixture.series).await.unwrap().len(), 4);
    let series = store.series(&fixture.series).await.unwrap().unwrap();
    assert_eq!((series.instances, series.state), (4, SeriesState::Receiving));
    assert_eq!(fixture.blobs().len(), 4);
}

#[tokio::test]
async fn a_row_that_names_a_lost_file_takes_a_good_copy_without_a_row() {
    let fixture = Fixture::new().await;
    let blob = fixture.blobs().remove(0);
    let (from, to) = (fixture.dir.path().join(&blob), fixture.dir.path().join("instances/00/copy.dcm"));
    fs::rename(from, to).unwrap();
    let store = fixture.reopened().await;
    let named: Vec<String> =
        store.instances(&fixture.series).await.unwrap().into_iter().map(|row| row.blob).collect();
    assert!(named.contains(&"instances/00/copy.dcm".to_owned()), "{named:?}");
    assert!(!Path::new(&fixture.dir.path().join("set-aside")).exists());
}

#[tokio::test]
async fn deadlines_follow_a_clock_that_is_set_back() {
    let fixture = Fixture::new().await;
    let policy = fixture.intake.policy();
    // As if they had been set before the clock went back by an hour.
    fixture.run("UPDATE series SET due_ms = due_ms + 3600000").await;
    fixture.run("UPDATE open_senders SET heard_ms = heard_ms + 3600000").await;
    fixture.store.catalog().follow_clock(policy).await.unwrap();
    let due = fixture.store.catalog().next_due_ms().await.unwrap().unwrap();
    assert!(due <= now_ms() + policy.quiet_ms, "due in {} ms", due - now_ms());
    let ended = super::SenderEnded {
        end: SenderEnd::UploadEnded,
        at: 1,
        cut: Vec::new(),
        of_series: Vec::new(),
        has_unnamed: false,
    };
    fixture.store.catalog().sender_ended(Uuid::nil(), &ended, policy).await.unwrap();
    let due = fixture.store.catalog().next_due_ms().await.unwrap().unwrap();
    assert!(due <= now_ms() + policy.quiet_after_association_ms, "due in {} ms", due - now_ms());

    fixture.intake.complete(&fixture.series, CompleteReason::Explicit).await.unwrap().unwrap();
    fixture.run("UPDATE reconstructions SET not_before_ms = not_before_ms + 3600000").await;
    let lease = std::time::Duration::from_secs(30);
    let claim = fixture.store.claim("w", lease).await.unwrap().expect("it may be claimed");
    fixture.run("UPDATE reconstructions SET lease_until_ms = lease_until_ms + 3600000").await;
    let reclaimed = fixture.store.reclaim(Reclaim::Expired, 3, &[]).await.unwrap();
    assert_eq!(reclaimed.len(), 1, "a lease is no longer than leases are");
    let claim =
        fixture.store.claim("w", lease).await.unwrap().map(|next| next.lease.fence > claim.lease.fence);
    assert_eq!(claim, Some(true));
}
