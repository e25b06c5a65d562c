//! The catalog: every row, and the only place with SQL.
//!
//! One connection writes, several read. Each change is one transaction, and a function that
//! belongs into a larger one takes the [`Transaction`]. Rows become the records of
//! [`super::records`] in [`rows`].

mod clinical;
mod completion;
mod corrections;
mod dialect;
mod identity;
mod instances;
mod leases;
mod queue;
mod reconstructions;
mod retention;
mod rows;
mod schema;
mod senders;
mod series;

use std::path::Path;

use uuid::Uuid;

use crate::error::Result;

pub(crate) use completion::{Completion, End, Policy};
pub(crate) use corrections::Settled;
pub(crate) use dialect::Transaction;
pub(crate) use instances::{Added, NewInstance, set_sha256};
pub(crate) use retention::Removed;
pub(crate) use schema::SchemaError;

/// The catalog of one data directory. Cheap to clone.
#[derive(Debug, Clone)]
pub(crate) struct Catalog {
    writer: dialect::Pool,
    readers: dialect::Pool,
    /// Tells the senders of this process from those of a dead one.
    process: String,
}

impl Catalog {
    /// Opens the file, or makes it, and brings it to this version's schema.
    pub(crate) async fn open(file: &Path) -> Result<Self, SchemaError> {
        let (writer, readers) = dialect::open(file).await?;
        let mut connection = writer.acquire().await?;
        schema::migrate(&mut connection).await?;
        identity::refresh(&mut connection).await?;
        drop(connection);
        Ok(Self { writer, readers, process: Uuid::new_v4().to_string() })
    }

    /// Begins a transaction that writes. Dropped without `commit`, it changes nothing.
    pub(crate) async fn begin(&self) -> Result<Transaction> {
        Ok(self.writer.begin_with(dialect::BEGIN_WRITING).await?)
    }

    /// Whether the database answers.
    pub(crate) async fn ping(&self) -> Result<()> {
        sqlx::query("SELECT 1").execute(&self.readers).await?;
        Ok(())
    }

    /// Ends all connections.
    pub(crate) async fn close(&self) {
        self.readers.close().await;
        self.writer.close().await;
    }
}

/// The time as the catalog writes it: Unix milliseconds.
pub(crate) fn now_ms() -> i64 {
    jiff::Timestamp::now().as_millisecond()
}
