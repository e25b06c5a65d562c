//! All that is particular to the database: types, how it is opened, how a writing transaction
//! begins. Every statement elsewhere is SQL that SQLite and PostgreSQL both understand
//! (`$1` parameters, `ON CONFLICT`, `RETURNING`).

use std::fs;
use std::io;
use std::ops::{Deref, DerefMut};
use std::os::unix::fs::{OpenOptionsExt as _, PermissionsExt as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use sqlx::AssertSqlSafe;
use sqlx::pool::PoolOptions;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqliteSynchronous};

use super::generation::Log;

/// The database.
pub(super) type Db = sqlx::Sqlite;
/// A row of it.
pub(super) type Row = sqlx::sqlite::SqliteRow;
/// A connection to it.
pub(super) type Connection = sqlx::SqliteConnection;
/// A pool of connections.
pub(super) type Pool = sqlx::Pool<Db>;

/// Takes the write lock at the beginning.
pub(super) const BEGIN_WRITING: &str = "BEGIN IMMEDIATE";

/// The size of the database, bytes.
pub(super) const SIZE: &str = "SELECT page_count * page_size FROM pragma_page_count(), pragma_page_size()";
/// The first fault of its pages, or `ok`.
pub(super) const QUICK_CHECK: &str = "PRAGMA quick_check(1)";

/// The schema, one numbered step after the other; a released step is never changed.
pub(super) const MIGRATIONS: &[(i64, &str)] = &[
    (1, include_str!("schema/sqlite/0001_catalog.sql")),
    (2, include_str!("schema/sqlite/0002_quality.sql")),
    (3, include_str!("schema/sqlite/0003_store.sql")),
    (4, include_str!("schema/sqlite/0004_identity.sql")),
    (5, include_str!("schema/sqlite/0005_results.sql")),
    (6, include_str!("schema/sqlite/0006_transfers.sql")),
    (7, include_str!("schema/sqlite/0007_seals.sql")),
    (8, include_str!("schema/sqlite/0008_generation.sql")),
    (9, include_str!("schema/sqlite/0009_corrections.sql")),
];

/// How long a connection waits for others.
pub(super) const PATIENCE: Duration = Duration::from_secs(10);

/// Readers don't wait for the writer (write-ahead log).
const READERS: u32 = 4;

/// The log file is cut to this size once all of it is in the database, bytes.
const WAL_KEPT: &str = "67108864";

/// A transaction that writes, on the one connection that does.
///
/// Unless it is committed its connection is closed, which rolls back, and the pool opens another
/// one. So it makes no difference how it ended: refused, failed half way, failed in the commit, or
/// dropped within a statement. After some errors (a full disk, I/O) SQLite has rolled back by
/// itself; a connection that is used on after that runs each statement for itself, or believes in a
/// transaction that is none.
#[derive(Debug)]
pub(crate) struct Transaction {
    connection: sqlx::pool::PoolConnection<Db>,
    log: Arc<Log>,
    committed: bool,
}

impl Transaction {
    /// Takes the write lock: a transaction that reads and then writes never finds that somebody
    /// wrote in between.
    pub(super) async fn begin(writer: &Pool, log: Arc<Log>) -> Result<Self, sqlx::Error> {
        let mut transaction = Self { connection: writer.acquire().await?, log, committed: false };
        sqlx::query(BEGIN_WRITING).execute(&mut *transaction.connection).await?;
        Ok(transaction)
    }

    /// Makes it durable. After an error only the catalog knows whether it is.
    pub(crate) async fn commit(mut self) -> Result<(), sqlx::Error> {
        sqlx::query("COMMIT").execute(&mut *self.connection).await?;
        match self.log.bound(&mut self.connection).await {
            Ok(()) => self.committed = true,
            // It is durable; the connection is not used again.
            Err(error) => tracing::warn!(%error, "the catalog's log can't be written into the catalog"),
        }
        Ok(())
    }
}

impl Drop for Transaction {
    fn drop(&mut self) {
        if !self.committed {
            self.connection.close_on_drop();
        }
    }
}

impl Deref for Transaction {
    type Target = Connection;

    fn deref(&self) -> &Connection {
        &self.connection
    }
}

impl DerefMut for Transaction {
    fn deref_mut(&mut self) -> &mut Connection {
        &mut self.connection
    }
}

/// The one connection that writes, and those that read.
pub(super) async fn open(file: &Path) -> Result<(Pool, Pool), sqlx::Error> {
    let kept = file.to_owned();
    tokio::task::spawn_blocking(move || for_the_owner_alone(&kept))
        .await
        .map_err(|panic| sqlx::Error::Io(io::Error::other(panic)))??;
    let options = SqliteConnectOptions::new()
        .filename(file)
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        // An acknowledged instance survives a power cut: the log is synced at every commit.
        .synchronous(SqliteSynchronous::Full)
        .foreign_keys(true)
        .pragma("journal_size_limit", WAL_KEPT)
        // `generation.rs` does it.
        .pragma("wal_autocheckpoint", "0")
        .busy_timeout(PATIENCE);
    let writer = PoolOptions::new()
        .max_connections(1)
        .acquire_timeout(Duration::from_secs(60))
        .idle_timeout(None)
        .max_lifetime(None)
        .connect_with(options.clone())
        .await?;
    // One stays open for good: the last connection to close takes the log with it, and a full disk
    // may not let the next one make it again.
    let readers =
        PoolOptions::new().min_connections(1).max_connections(READERS).connect_with(options).await?;
    Ok((writer, readers))
}

/// A reader of a catalog that another process may be writing; changes nothing.
pub(super) async fn open_to_read(file: &Path) -> Result<Pool, sqlx::Error> {
    PoolOptions::new().max_connections(1).connect_with(options_to_read(file)).await
}

/// The options of a connection that changes nothing.
pub(super) fn options_to_read(file: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new().filename(file).create_if_missing(false).read_only(true).busy_timeout(PATIENCE)
}

/// How long the connection waits for others from now on.
pub(super) async fn set_patience(connection: &mut Connection, patience: Duration) -> Result<(), sqlx::Error> {
    let statement = format!("PRAGMA busy_timeout = {}", patience.as_millis());
    sqlx::query(AssertSqlSafe(statement)).execute(connection).await.map(drop)
}

/// Makes the file, or takes everybody else's rights from it and from the log beside it. The
/// database gives the log and its index the rights of the file.
fn for_the_owner_alone(file: &Path) -> io::Result<()> {
    fs::OpenOptions::new().create(true).append(true).mode(0o600).open(file)?;
    for path in files_of(file) {
        match fs::set_permissions(&path, fs::Permissions::from_mode(0o600)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
    }
    Ok(())
}

/// The file, its log and the log's index.
pub(crate) fn files_of(file: &Path) -> [PathBuf; 3] {
    ["", "-wal", "-shm"].map(|end| {
        let mut name = file.as_os_str().to_owned();
        name.push(end);
        PathBuf::from(name)
    })
}
