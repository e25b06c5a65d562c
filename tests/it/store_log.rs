//! A catalog that was brought back from a backup, with the log of its successor still beside it, is not
//! mixed with that log: nothing is changed before somebody says which of them counts.

use std::fs;
use std::path::{Path, PathBuf};

use sqlx::Connection as _;
use sqlx::sqlite::SqliteConnectOptions;
use tempfile::tempdir;
use triplanar::store::{OpenError, Store};
use uuid::Uuid;

use crate::support::entrance::{Entrance, settings};
use crate::support::service::{Settings, run, triplanar};

/// A folder as it is: what `kill -9` would leave.
fn image(from: &Path, to: PathBuf) -> PathBuf {
    fs::create_dir_all(&to).expect("a folder");
    for entry in fs::read_dir(from).expect("a folder") {
        let entry = entry.expect("an entry");
        let (path, name) = (entry.path(), entry.file_name());
        if path.is_dir() {
            image(&path, to.join(name));
        } else {
            fs::copy(&path, to.join(name)).expect("a copy");
        }
    }
    to
}

fn log_length(data: &Path) -> u64 {
    fs::metadata(data.join("catalog.sqlite-wal")).map_or(0, |metadata| metadata.len())
}

async fn instances(data: &Path, series: u32) -> u64 {
    let entrance = Entrance::open(settings(data)).await;
    let instances = entrance.series(series).await.instances;
    entrance.stop().await;
    instances
}

/// Refused by each door without a change; usable again once the log is gone, and nothing is lost.
async fn is_refused(data: &Path, expected: u64) {
    let whole = |name: &str| fs::read(data.join(name)).expect("it is there");
    let before = (whole("catalog.sqlite"), whole("catalog.sqlite-wal"));
    assert!(!before.1.is_empty());
    let storage = settings(data).storage;
    let opened = Store::open(&storage).await.err();
    assert!(matches!(opened, Some(OpenError::ForeignLog(_))), "{opened:?}");
    let checked = Store::check(&storage).await.err();
    assert!(matches!(checked, Some(OpenError::ForeignLog(_))), "{checked:?}");
    let output = Settings::new().refused(data);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success(), "{told}");
    for word in ["catalog.sqlite-wal", "catalog.sqlite-shm", "backup", "triplanar rebuild"] {
        assert!(told.contains(word), "{word}: {told}");
    }
    assert!((whole("catalog.sqlite"), whole("catalog.sqlite-wal")) == before, "nothing was changed");

    let other = image(data, data.with_extension("rebuilt"));
    let mut command = triplanar();
    command.args(["rebuild", "--data-dir"]).arg(&other);
    assert!(run(command).status.success(), "the other way out");
    assert_eq!(instances(&other, 1).await, expected);

    for name in ["catalog.sqlite-wal", "catalog.sqlite-shm"] {
        let _the_index_may_be_gone = fs::remove_file(data.join(name));
    }
    assert_eq!(instances(data, 1).await, expected, "what came after the backup is entered from its files");
}

/// Makes a catalog one of schema 7, the last one without names.
async fn downgrade(data: &Path) {
    let options = SqliteConnectOptions::new().filename(data.join("catalog.sqlite"));
    let mut connection = sqlx::SqliteConnection::connect_with(&options).await.unwrap();
    let statements = "DROP TABLE generation; DROP TABLE attribute_changes; \
                      DELETE FROM schema_version WHERE version >= 8; \
                      PRAGMA user_version = 0; PRAGMA wal_checkpoint(TRUNCATE)";
    sqlx::raw_sql(statements).execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();
}

#[tokio::test]
async fn a_log_of_after_an_upgrade_beside_a_catalog_of_before_it_is_refused() {
    let dir = tempdir().unwrap();
    let data = dir.path().join("data");
    let entrance = Entrance::open(settings(&data)).await;
    entrance.send_all(Uuid::new_v4(), 1, 1..3).await;
    entrance.stop().await;
    downgrade(&data).await;
    let backup = fs::read(data.join("catalog.sqlite")).unwrap();

    let entrance = Entrance::open(settings(&data)).await;
    let upgraded = image(&data, dir.path().join("upgraded"));
    assert!(log_length(&upgraded) > 0);
    entrance.send_all(Uuid::new_v4(), 1, 3..6).await;
    let own = image(&data, dir.path().join("own"));
    let foreign = image(&data, dir.path().join("foreign"));
    entrance.stop().await;
    assert_eq!((instances(&own, 1).await, instances(&data, 1).await), (5, 5), "a log of its own is replayed");
    for (data, expected) in [(&upgraded, 2), (&foreign, 5)] {
        fs::write(data.join("catalog.sqlite"), &backup).unwrap();
        is_refused(data, expected).await;
    }
}

#[tokio::test]
async fn a_log_beside_a_catalog_from_a_backup_is_refused_and_its_own_is_not() {
    let dir = tempdir().unwrap();
    let data = dir.path().join("data");
    let entrance = Entrance::open(settings(&data)).await;
    entrance.send_all(Uuid::new_v4(), 1, 1..3).await;
    entrance.stop().await;
    let backup = fs::read(data.join("catalog.sqlite")).unwrap();

    let entrance = Entrance::open(settings(&data)).await;
    entrance.send_all(Uuid::new_v4(), 1, 3..6).await;
    assert!(log_length(&data) > 0);
    let own = image(&data, dir.path().join("own"));
    let foreign = image(&data, dir.path().join("foreign"));
    assert_eq!(instances(&own, 1).await, 5, "a log of its own is replayed");
    fs::write(foreign.join("catalog.sqlite"), &backup).unwrap();
    is_refused(&foreign, 5).await;

    // A copy that was made while the same service ran, before it last emptied its log.
    let earlier = fs::read(data.join("catalog.sqlite")).unwrap();
    let mut number = 100;
    let mut longest = 0;
    while log_length(&data) >= longest {
        longest = log_length(&data);
        entrance.send_all(Uuid::new_v4(), 2, number..number + 1).await;
        number += 1;
        assert!(number < 2_000, "the log grows to {longest} bytes");
    }
    entrance.send_all(Uuid::new_v4(), 1, 6..8).await;
    let own = image(&data, dir.path().join("own later"));
    let foreign = image(&data, dir.path().join("foreign later"));
    assert_eq!(instances(&own, 1).await, 7);
    fs::write(foreign.join("catalog.sqlite"), &earlier).unwrap();
    is_refused(&foreign, 7).await;
    entrance.stop().await;
    assert_eq!(instances(&data, 1).await, 7);
}
