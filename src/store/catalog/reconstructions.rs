//! Reconstructions: reading, superseding, removal.

use sqlx::Row as _;

use super::dialect::{Connection, Row};
use super::rows::ResultFiles;
use super::series::invalid_cursor;
use super::{Catalog, Removed, rows};
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::Result;
use crate::pipeline::Parameters;
use crate::store::records::{Page, ReconstructionFilter, ReconstructionId, ReconstructionRecord};
use crate::store::stored::identity_sha256;

impl Catalog {
    pub(crate) async fn reconstruction(&self, id: ReconstructionId) -> Result<Option<ReconstructionRecord>> {
        one(&mut *self.readers.acquire().await?, id).await
    }

    pub(crate) async fn list_reconstructions(
        &self,
        filter: &ReconstructionFilter,
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<ReconstructionRecord>> {
        let after = cursor.map(str::parse::<ReconstructionId>).transpose().map_err(|_| invalid_cursor())?;
        // Ids are UUIDv7: their order is that of time.
        let found = sqlx::query(
            "SELECT * FROM reconstructions WHERE ($1 IS NULL OR series_uid = $1) AND ($2 IS NULL OR state = $2) \
             AND ($3 IS NULL OR id < $3) ORDER BY id DESC LIMIT $4",
        )
        .bind(filter.series_instance_uid.as_ref().map(|uid| uid.as_str()))
        .bind(filter.state.map(|state| state.name()))
        .bind(after.map(|id| id.to_string()))
        .bind(i64::from(limit) + 1)
        .fetch_all(&self.readers)
        .await?;
        rows::page(&found, limit, rows::reconstruction, |last| last.try_get("id"))
    }

    /// Its files, if it has any.
    pub(crate) async fn result_of(&self, id: ReconstructionId) -> Result<Option<ResultFiles>> {
        let row = sqlx::query("SELECT id, result, result_files FROM reconstructions WHERE id = $1")
            .bind(id.to_string())
            .fetch_optional(&self.readers)
            .await?;
        row.as_ref().map(rows::result_files).transpose().map(Option::flatten)
    }

    /// Whether a row names the result.
    pub(crate) async fn names_result(&self, prefix: &str) -> Result<bool> {
        let rows: i64 = sqlx::query_scalar("SELECT COUNT(*) FROM reconstructions WHERE result = $1")
            .bind(prefix)
            .fetch_one(&self.readers)
            .await?;
        Ok(rows > 0)
    }

    /// Removes it; `None` if there is none.
    pub(crate) async fn delete_reconstruction(&self, id: ReconstructionId) -> Result<Option<Removed>> {
        let mut tx = self.begin().await?;
        let gone: Option<Option<String>> =
            sqlx::query_scalar("DELETE FROM reconstructions WHERE id = $1 RETURNING result")
                .bind(id.to_string())
                .fetch_optional(&mut *tx)
                .await?;
        sqlx::query("UPDATE reconstructions SET superseded_by = NULL WHERE superseded_by = $1")
            .bind(id.to_string())
            .execute(&mut *tx)
            .await?;
        let removed = gone.map(|result| Removed { blobs: Vec::new(), results: result.into_iter().collect() });
        if let Some(removed) = &removed {
            super::removed::note(&mut tx, removed).await?;
        }
        tx.commit().await?;
        Ok(removed)
    }
}

/// One reconstruction as it is in this connection's transaction.
pub(super) async fn one(
    connection: &mut Connection,
    id: ReconstructionId,
) -> Result<Option<ReconstructionRecord>> {
    let row = sqlx::query("SELECT * FROM reconstructions WHERE id = $1")
        .bind(id.to_string())
        .fetch_optional(connection)
        .await?;
    row.as_ref().map(rows::reconstruction).transpose()
}

/// The one of this set of instances with these parameters.
pub(super) async fn id_of(
    connection: &mut Connection,
    series: &SeriesInstanceUid,
    set: &[u8; 32],
    parameters: &Parameters,
) -> Result<Option<ReconstructionId>> {
    let row = sqlx::query(
        "SELECT id FROM reconstructions WHERE series_uid = $1 AND instances_sha256 = $2 AND parameters_sha256 = $3",
    )
    .bind(series.as_str())
    .bind(set.as_slice())
    .bind(identity_sha256(parameters).as_slice())
    .fetch_optional(connection)
    .await?;
    Ok(row.map(|row| rows::parsed(&row, "id")).transpose()?)
}

/// `succeeded` has just succeeded: those of earlier revisions with its parameters are superseded by
/// it, whatever the version of the algorithm that made them; it is itself superseded if one of a later
/// revision was faster.
pub(super) async fn supersede(connection: &mut Connection, succeeded: &Row) -> Result<()> {
    let id: &str = succeeded.try_get("id")?;
    let series: &str = succeeded.try_get("series_uid")?;
    let settings: &[u8] = succeeded.try_get("settings_sha256")?;
    let revision: i64 = succeeded.try_get("revision")?;
    sqlx::query(
        "UPDATE reconstructions SET state = 'superseded', superseded_by = $1 \
         WHERE series_uid = $2 AND settings_sha256 = $3 AND revision < $4 AND state = 'succeeded'",
    )
    .bind(id)
    .bind(series)
    .bind(settings)
    .bind(revision)
    .execute(&mut *connection)
    .await?;
    let later: Option<String> = sqlx::query_scalar(
        "SELECT id FROM reconstructions WHERE series_uid = $1 AND settings_sha256 = $2 AND revision > $3 \
         AND state = 'succeeded' ORDER BY revision DESC LIMIT 1",
    )
    .bind(series)
    .bind(settings)
    .bind(revision)
    .fetch_optional(&mut *connection)
    .await?;
    if let Some(later) = later {
        sqlx::query("UPDATE reconstructions SET state = 'superseded', superseded_by = $2 WHERE id = $1")
            .bind(id)
            .bind(later)
            .execute(connection)
            .await?;
    }
    Ok(())
}
