//! All that is particular to the database: types, how it is opened, how a writing transaction
//! begins. Every statement elsewhere is SQL that SQLite and PostgreSQL both understand
//! (`$1` parameters, `ON CONFLICT`, `RETURNING`).

use std::path::Path;
use std::time::Duration;

use sqlx::pool::PoolOptions;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqliteSynchronous};

/// The database.
pub(super) type Db = sqlx::Sqlite;
/// A row of it.
pub(super) type Row = sqlx::sqlite::SqliteRow;
/// A connection to it.
pub(super) type Connection = sqlx::SqliteConnection;
/// A transaction.
pub(crate) type Transaction = sqlx::Transaction<'static, Db>;
/// A pool of connections.
pub(super) type Pool = sqlx::Pool<Db>;

/// Takes the write lock at the beginning: a transaction that reads and then writes never finds
/// that somebody wrote in between.
pub(super) const BEGIN_WRITING: &str = "BEGIN IMMEDIATE";

/// The schema, one numbered step after the other; a released step is never changed.
pub(super) const MIGRATIONS: &[(i64, &str)] = &[
    (1, include_str!("schema/sqlite/0001_catalog.sql")),
    (2, include_str!("schema/sqlite/0002_quality.sql")),
    (4, include_str!("schema/sqlite/0004_identity.sql")),
    (5, include_str!("schema/sqlite/0005_results.sql")),
];

/// Readers don't wait for the writer (write-ahead log).
const READERS: u32 = 4;

/// The one connection that writes, and those that read.
pub(super) async fn open(file: &Path) -> Result<(Pool, Pool), sqlx::Error> {
    let options = SqliteConnectOptions::new()
        .filename(file)
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        // An acknowledged instance survives a power cut: the log is synced at every commit.
        .synchronous(SqliteSynchronous::Full)
        .foreign_keys(true)
        .busy_timeout(Duration::from_secs(10));
    let writer = PoolOptions::new()
        .max_connections(1)
        .acquire_timeout(Duration::from_secs(60))
        .idle_timeout(None)
        .max_lifetime(None)
        .connect_with(options.clone())
        .await?;
    let readers = PoolOptions::new().max_connections(READERS).connect_with(options).await?;
    Ok((writer, readers))
}
