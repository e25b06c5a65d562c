//! The catalog: every row, and the only place with SQL.
//!
//! One connection writes, several read. Each change is one transaction, and a function that
//! belongs into a larger one takes the [`Transaction`]. Rows become the records of
//! [`super::records`] in [`rows`].

mod clinical;
mod completion;
mod corrections;
mod dialect;
mod dump;
mod generation;
mod identity;
mod instances;
mod leases;
mod queue;
mod reader;
mod readiness;
mod reconstructions;
mod recovery;
mod removed;
mod restoring;
mod retention;
mod rows;
mod schema;
mod senders;
mod series;
mod transfers;

use std::path::Path;
use std::sync::Arc;

use uuid::Uuid;

use crate::error::Result;

pub(crate) use clinical::Chosen;
pub(crate) use completion::{Completion, End, Policy};
pub(crate) use corrections::Settled;
pub(crate) use dialect::{Transaction, files_of};
pub(crate) use dump::{Columns, bytes};
pub(crate) use instances::{Added, NewInstance, set_sha256};
pub(crate) use leases::Ended;
pub(crate) use reader::{CatalogReader, InstanceRow, ResultRow};
pub(crate) use recovery::Found;
pub(crate) use removed::Removed;
pub(crate) use rows::ResultFiles;
pub(crate) use schema::SchemaError;
pub(crate) use transfers::{Ended as SenderEnded, OpenSender};

/// The catalog of one data directory. Cheap to clone.
#[derive(Debug, Clone)]
pub(crate) struct Catalog {
    writer: dialect::Pool,
    readers: dialect::Pool,
    log: Arc<generation::Log>,
    /// Tells the senders of this process from those of a dead one.
    process: String,
}

impl Catalog {
    /// Opens the file, or makes it if it `may_be_new`, and brings it to this version's schema.
    pub(crate) async fn open(file: &Path, may_be_new: bool) -> Result<Self, SchemaError> {
        if generation::has_foreign_log(file).await? {
            return Err(SchemaError::ForeignLog);
        }
        let (writer, readers) = dialect::open(file).await?;
        let prepared = async {
            let mut connection = writer.acquire().await?;
            if let Some(found) = readiness::damage(&mut connection).await? {
                return Err(SchemaError::Damaged(found));
            }
            schema::migrate(&mut connection, may_be_new).await?;
            identity::refresh(&mut connection).await?;
            // The schema leaves the log: a catalog that has lost its log still tells that it is not new.
            generation::checkpoint(&mut connection).await?;
            Ok(())
        };
        let prepared: Result<(), SchemaError> = prepared.await;
        if let Err(error) = prepared {
            readers.close().await;
            writer.close().await;
            return Err(error);
        }
        let log = Arc::new(generation::Log::of(file));
        Ok(Self { writer, readers, log, process: Uuid::new_v4().to_string() })
    }

    /// Begins a transaction that writes. Dropped without `commit`, it changes nothing.
    pub(crate) async fn begin(&self) -> Result<Transaction> {
        Ok(Transaction::begin(&self.writer, Arc::clone(&self.log)).await?)
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
