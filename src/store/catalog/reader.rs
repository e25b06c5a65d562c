//! The catalog as `triplanar check` reads it: of any version since 0.1, whether a service uses it or
//! not, without a change to it.

use std::path::Path;

use sqlx::Row as _;

use super::{dialect, rows};
use crate::dicom::uid::{SeriesInstanceUid, SopClassUid, SopInstanceUid, TransferSyntaxUid};
use crate::error::Result;
use crate::store::hashed::Seal;
use crate::store::records::ReconstructionState;

/// See the module.
#[derive(Debug)]
pub(crate) struct CatalogReader(dialect::Pool);

/// An instance, as far as every version's catalog tells it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct InstanceRow {
    pub(crate) series: SeriesInstanceUid,
    pub(crate) sop_instance: SopInstanceUid,
    pub(crate) sop_class: SopClassUid,
    pub(crate) transfer_syntax: TransferSyntaxUid,
    pub(crate) blob: String,
    pub(crate) size: u64,
    pub(crate) data_set_sha256: [u8; 32],
}

/// A result that a row names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ResultRow {
    pub(crate) id: String,
    pub(crate) series: String,
    pub(crate) prefix: String,
    /// `None`: of release 0.1.
    pub(crate) seal: Option<Seal>,
    pub(crate) has_cloud: bool,
}

impl CatalogReader {
    pub(crate) async fn open(file: &Path) -> Result<Self> {
        Ok(Self(dialect::open_to_read(file).await?))
    }

    /// Whether a log lies beside the file that is another file's.
    pub(crate) async fn has_foreign_log(file: &Path) -> Result<bool> {
        Ok(super::generation::has_foreign_log(file).await?)
    }

    /// What the database finds wrong with itself.
    pub(crate) async fn integrity(&self) -> Result<Vec<String>> {
        let lines: Vec<String> = sqlx::query_scalar("PRAGMA integrity_check").fetch_all(&self.0).await?;
        Ok(lines.into_iter().filter(|line| line != "ok").collect())
    }

    /// The number of its last schema step, and that of this software.
    pub(crate) async fn schema(&self) -> Result<(i64, i64)> {
        let found: Option<i64> =
            sqlx::query_scalar("SELECT MAX(version) FROM schema_version").fetch_one(&self.0).await?;
        Ok((found.unwrap_or(0), super::schema::latest()))
    }

    pub(crate) async fn instances(&self) -> Result<Vec<InstanceRow>> {
        let found = sqlx::query("SELECT * FROM instances ORDER BY series_uid, sop_uid").fetch_all(&self.0);
        let instance = |row: &dialect::Row| {
            Ok(InstanceRow {
                series: rows::parsed(row, "series_uid")?,
                sop_instance: rows::parsed(row, "sop_uid")?,
                sop_class: rows::parsed(row, "sop_class_uid")?,
                transfer_syntax: rows::parsed(row, "transfer_syntax_uid")?,
                blob: row.try_get("blob")?,
                size: rows::number(row, "size")?,
                data_set_sha256: rows::sha256(row, "data_set_sha256")?,
            })
        };
        found.await?.iter().map(instance).collect()
    }

    pub(crate) async fn results(&self) -> Result<Vec<ResultRow>> {
        let found = sqlx::query("SELECT * FROM reconstructions WHERE result IS NOT NULL ORDER BY id");
        let found = found.fetch_all(&self.0).await?;
        let row = |row: &dialect::Row| {
            let state: &str = row.try_get("state")?;
            Ok(ResultRow {
                id: row.try_get("id")?,
                series: row.try_get("series_uid")?,
                prefix: row.try_get("result")?,
                seal: match row.try_get("result_files") {
                    // A catalog of an earlier version.
                    Err(sqlx::Error::ColumnNotFound(_)) => None,
                    json => rows::seal(json?)?,
                },
                has_cloud: ReconstructionState::from_name(state).is_some_and(ReconstructionState::has_cloud),
            })
        };
        found.iter().map(row).collect()
    }

    /// Keys of instances and prefixes of results that rows name now.
    pub(crate) async fn named(&self) -> Result<Vec<String>> {
        let named = sqlx::query_scalar(
            "SELECT blob FROM instances UNION ALL SELECT result FROM reconstructions WHERE result IS NOT NULL",
        );
        Ok(named.fetch_all(&self.0).await?)
    }

    pub(crate) async fn close(&self) {
        self.0.close().await;
    }
}
