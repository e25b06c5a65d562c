//! The catalog as `triplanar check` reads it: of any version since 0.1, whether a service uses it or
//! not, without a change to it.

use std::path::Path;

use sqlx::Row as _;

use super::{dialect, rows};
use crate::error::Result;
use crate::store::records::{InstanceRecord, ReconstructionState};

/// See the module.
#[derive(Debug)]
pub(crate) struct CatalogReader(dialect::Pool);

/// A result that a row names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ResultRow {
    pub(crate) id: String,
    pub(crate) series: String,
    pub(crate) prefix: String,
    pub(crate) has_cloud: bool,
}

impl CatalogReader {
    pub(crate) async fn open(file: &Path) -> Result<Self> {
        Ok(Self(dialect::open_to_read(file).await?))
    }

    /// What the database finds wrong with itself.
    pub(crate) async fn integrity(&self) -> Result<Vec<String>> {
        let lines: Vec<String> = sqlx::query_scalar("PRAGMA integrity_check").fetch_all(&self.0).await?;
        Ok(lines.into_iter().filter(|line| line != "ok").collect())
    }

    pub(crate) async fn instances(&self) -> Result<Vec<InstanceRecord>> {
        let found = sqlx::query("SELECT * FROM instances ORDER BY series_uid, sop_uid").fetch_all(&self.0);
        Ok(found.await?.iter().map(rows::instance).collect::<Result<_, _>>()?)
    }

    pub(crate) async fn results(&self) -> Result<Vec<ResultRow>> {
        let found = sqlx::query(
            "SELECT id, series_uid, result, state FROM reconstructions WHERE result IS NOT NULL ORDER BY id",
        )
        .fetch_all(&self.0)
        .await?;
        let row = |row: &dialect::Row| {
            let state: &str = row.try_get("state")?;
            Ok(ResultRow {
                id: row.try_get("id")?,
                series: row.try_get("series_uid")?,
                prefix: row.try_get("result")?,
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
