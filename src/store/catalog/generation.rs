//! Which log belongs to which catalog file.
//!
//! SQLite replays a write-ahead log that lies beside a database onto it, whatever database that is: a
//! catalog that was brought back from a backup, with the log of the one before it still there, becomes a
//! mixture of both. So the file and its log carry names:
//!
//! 1. `base = current`, `current = ` a new name, in the log;
//! 2. the log is written into the file and emptied;
//! 3. `base = current`, the first entry of the new log, and with it the first page of the file.
//!
//! Where a reader is in the way of step 2, the file may be called either, and step 1 comes again with both
//! as its base. So the file read without its log is called what the log, read with the file, says is its
//! base or the current one, whatever moment the process died in. A log that says neither is another file's.
//! Nothing but this checkpoint may empty the log: `wal_autocheckpoint` is 0.
//!
//! Catalogs of schema 7 and before have no names, and what their successor's log changed may not show where
//! the table with the names is. The number in the first page tells: step 3 alone sets it, when the table is in
//! the file. A file without the table that has the number with a log has another file's log.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use sqlx::Connection as _;
use sqlx::sqlite::SqliteConnectOptions;
use uuid::Uuid;

use super::dialect::{self, BEGIN_WRITING, Connection, files_of};

/// The log is written into the file when it is longer, bytes: SQLite's own 1000 pages of 4096.
const LOG_BYTES: u64 = 4096 * 1000;
/// Sets the number in the first page of the file (catalogs of schema 7 and before have 0), which writes it
/// even where it stays the same.
const SET_NUMBER: &str = "PRAGMA user_version = 8";
/// How long a checkpoint waits for readers; writers wait for it.
const WAIT_FOR_READERS: Duration = Duration::from_millis(200);

/// The log of a catalog file.
#[derive(Debug)]
pub(super) struct Log {
    path: PathBuf,
    /// The length at which it is written into the file next.
    next: AtomicU64,
}

impl Log {
    pub(super) fn of(file: &Path) -> Self {
        let [_, path, _] = files_of(file);
        Self { path, next: AtomicU64::new(LOG_BYTES) }
    }

    /// Writes it into the file if it is long; a reader that is in the way is waited for at the next
    /// opportunity.
    pub(super) async fn bound(&self, connection: &mut Connection) -> Result<(), sqlx::Error> {
        let length = fs::metadata(&self.path).map_or(0, |metadata| metadata.len());
        if length < self.next.load(Ordering::Relaxed) {
            return Ok(());
        }
        let emptied = checkpoint(connection).await?;
        self.next.store(if emptied { LOG_BYTES } else { length + LOG_BYTES }, Ordering::Relaxed);
        Ok(())
    }
}

/// Writes the log into the file and empties it; see the module. False: a reader was in the way.
pub(super) async fn checkpoint(connection: &mut Connection) -> Result<bool, sqlx::Error> {
    sqlx::query(
        "UPDATE generation SET base = CASE WHEN base = current THEN current ELSE base || ' ' || current END, \
         current = $1",
    )
    .bind(Uuid::new_v4().to_string())
    .execute(&mut *connection)
    .await?;
    dialect::set_patience(connection, WAIT_FOR_READERS).await?;
    let told = sqlx::query_as("PRAGMA wal_checkpoint(TRUNCATE)").fetch_one(&mut *connection).await;
    dialect::set_patience(connection, dialect::PATIENCE).await?;
    // Whether a reader was in the way; pages of the log; how many of them are in the file.
    let (busy, pages, written): (i64, i64, i64) = told?;
    // One that is in the file whole may be begun anew by the next write, although it is not emptied.
    if busy == 0 || pages == written {
        let mut tx = connection.begin_with(BEGIN_WRITING).await?;
        sqlx::query("UPDATE generation SET base = current").execute(&mut *tx).await?;
        sqlx::query(SET_NUMBER).execute(&mut *tx).await?;
        tx.commit().await?;
    }
    Ok(busy == 0)
}

/// Whether a log lies beside the file that is another file's. Changes neither. A file that can't be read
/// without its log, as a half-written one, is for the database to judge.
pub(super) async fn has_foreign_log(file: &Path) -> Result<bool, sqlx::Error> {
    let length = |path: &Path| match fs::metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(0),
        metadata => metadata.map(|metadata| metadata.len()),
    };
    let [_, log, _] = files_of(file);
    if length(file)? == 0 || length(&log)? == 0 {
        return Ok(false);
    }
    let alone = || dialect::options_to_read(file).immutable(true);
    let with_log = || dialect::options_to_read(file);
    let Ok(of_file) = names(alone()).await else { return Ok(false) };
    if of_file.is_none() {
        let (Ok(0), Ok(number)) = (number(alone()).await, number(with_log()).await) else { return Ok(false) };
        if number != 0 {
            return Ok(true);
        }
    }
    let Ok(of_both) = names(with_log()).await else { return Ok(false) };
    let ((_, name), (base, current)) = (of_file.unwrap_or_default(), of_both.unwrap_or_default());
    Ok(name != current && !base.split(' ').any(|base| base == name))
}

/// The number in the first page of the file.
async fn number(options: SqliteConnectOptions) -> Result<i64, sqlx::Error> {
    let mut connection = Connection::connect_with(&options).await?;
    let number = sqlx::query_scalar("PRAGMA user_version").fetch_one(&mut connection).await;
    connection.close().await?;
    number
}

/// `base` and `current`; `None` in a catalog of an earlier version.
async fn names(options: SqliteConnectOptions) -> Result<Option<(String, String)>, sqlx::Error> {
    let mut connection = Connection::connect_with(&options).await?;
    let known: Result<i64, _> =
        sqlx::query_scalar("SELECT COUNT(*) FROM sqlite_master WHERE name = 'generation'")
            .fetch_one(&mut connection)
            .await;
    let names = match known {
        Ok(0) => Ok(None),
        Ok(_) => {
            sqlx::query_as("SELECT base, current FROM generation").fetch_one(&mut connection).await.map(Some)
        }
        Err(error) => Err(error),
    };
    connection.close().await?;
    names
}

#[cfg(test)]
mod tests {
    use super::super::Catalog;
    use super::*;

    /// The file and its log as a process leaves them that dies now.
    fn image(file: &Path, to: &Path) {
        for (from, to) in files_of(file).iter().zip(files_of(to)).take(2) {
            fs::copy(from, to).expect("a copy");
        }
    }

    #[tokio::test]
    async fn a_log_is_its_own_files_whatever_moment_the_process_dies_in() {
        let dir = tempfile::tempdir().unwrap();
        let (file, copy) = (dir.path().join("catalog.sqlite"), dir.path().join("copy.sqlite"));
        let catalog = Catalog::open(&file, true).await.unwrap();
        let own = async |when: &str| {
            image(&file, &copy);
            assert!(!has_foreign_log(&copy).await.unwrap(), "{when}");
        };
        let mut writer = catalog.writer.acquire().await.unwrap();
        let write = "UPDATE readiness SET written_ms = written_ms + 1";
        own("opened").await;
        sqlx::query("UPDATE generation SET current = 'next' WHERE base = current")
            .execute(&mut *writer)
            .await
            .unwrap();
        own("named").await;
        // A reader that stays keeps the log from being emptied.
        let mut reader = catalog.readers.acquire().await.unwrap();
        sqlx::query("BEGIN").execute(&mut *reader).await.unwrap();
        sqlx::query("SELECT * FROM generation").fetch_all(&mut *reader).await.unwrap();
        sqlx::query(write).execute(&mut *writer).await.unwrap();
        assert!(!checkpoint(&mut writer).await.unwrap());
        own("a reader in the way").await;
        assert!(!checkpoint(&mut writer).await.unwrap());
        own("a reader in the way again").await;
        sqlx::query("ROLLBACK").execute(&mut *reader).await.unwrap();
        let former = fs::read(&file).unwrap();
        sqlx::query("PRAGMA wal_checkpoint(PASSIVE)").execute(&mut *writer).await.unwrap();
        own("written, not emptied").await;
        assert!(checkpoint(&mut writer).await.unwrap());
        own("emptied").await;
        assert!(checkpoint(&mut writer).await.unwrap());
        sqlx::query(write).execute(&mut *writer).await.unwrap();
        own("written to").await;
        fs::write(&copy, former).unwrap();
        assert!(has_foreign_log(&copy).await.unwrap(), "the file of an earlier state");
    }
}
