//! Series: reading, removal.

use sqlx::Row as _;

use super::clinical::served;
use super::dialect::{Connection, Row};
use super::{Catalog, rows};
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::{Error, Result};
use crate::store::records::{Page, SeriesFilter, SeriesRecord};

macro_rules! select_series {
    ($rest:literal) => {
        concat!(
            "SELECT s.*, e.expected_instances, \
             (SELECT COUNT(DISTINCT r.sop_uid) FROM refused r WHERE r.series_uid = s.series_uid) AS refused_instances, \
             (SELECT COUNT(*) FROM refused r WHERE r.series_uid = s.series_uid AND r.held) AS held_refusals, \
             (SELECT algorithm FROM reconstructions c WHERE c.series_uid = s.series_uid AND ",
            served!(),
            ") AS served_algorithm \
             FROM series s LEFT JOIN expectations e ON e.series_uid = s.series_uid ",
            $rest
        )
    };
}

impl Catalog {
    pub(crate) async fn series(&self, uid: &SeriesInstanceUid) -> Result<Option<SeriesRecord>> {
        one(&mut *self.readers.acquire().await?, uid).await
    }

    pub(crate) async fn list_series(
        &self,
        filter: &SeriesFilter,
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<SeriesRecord>> {
        let after = cursor.map(parse_cursor).transpose()?;
        let (after_ms, after_uid) = after.unzip();
        let found = sqlx::query(select_series!(
            "WHERE ($1 IS NULL OR s.patient_id = $1) AND ($2 IS NULL OR s.accession_number = $2) \
             AND ($3 IS NULL OR s.study_uid = $3) AND ($4 IS NULL OR s.state = $4) \
             AND ($5 IS NULL OR s.created_ms < $5 OR (s.created_ms = $5 AND s.series_uid < $6)) \
             ORDER BY s.created_ms DESC, s.series_uid DESC LIMIT $7"
        ))
        .bind(filter.patient_id.as_deref())
        .bind(filter.accession_number.as_deref())
        .bind(filter.study_instance_uid.as_ref().map(|uid| uid.as_str()))
        .bind(filter.state.map(|state| state.name()))
        .bind(after_ms)
        .bind(after_uid)
        .bind(i64::from(limit) + 1)
        .fetch_all(&self.readers)
        .await?;
        let cursor = |last: &Row| {
            let (created_ms, uid): (i64, &str) = (last.try_get("created_ms")?, last.try_get("series_uid")?);
            Ok(hex::encode(format!("{created_ms}:{uid}")))
        };
        rows::page(&found, limit, rows::series, cursor)
    }

    /// Removes the series and all that hangs on it. Gives the keys of the blobs that no row names
    /// any more; `None` if there is no such series.
    pub(crate) async fn delete_series(&self, uid: &SeriesInstanceUid) -> Result<Option<super::Removed>> {
        let mut tx = self.begin().await?;
        let mut removed = super::Removed {
            blobs: sqlx::query_scalar("SELECT blob FROM instances WHERE series_uid = $1")
                .bind(uid.as_str())
                .fetch_all(&mut *tx)
                .await?,
            results: sqlx::query_scalar(
                "SELECT result FROM reconstructions WHERE series_uid = $1 AND result IS NOT NULL",
            )
            .bind(uid.as_str())
            .fetch_all(&mut *tx)
            .await?,
        };
        let replaced: Vec<String> =
            sqlx::query_scalar("DELETE FROM replaced_blobs WHERE series_uid = $1 RETURNING blob")
                .bind(uid.as_str())
                .fetch_all(&mut *tx)
                .await?;
        removed.blobs.extend(replaced);
        // Instances, senders and reconstructions go with it.
        let gone = sqlx::query("DELETE FROM series WHERE series_uid = $1")
            .bind(uid.as_str())
            .execute(&mut *tx)
            .await?;
        sqlx::query("DELETE FROM expectations WHERE series_uid = $1")
            .bind(uid.as_str())
            .execute(&mut *tx)
            .await?;
        sqlx::query("DELETE FROM refused WHERE series_uid = $1").bind(uid.as_str()).execute(&mut *tx).await?;
        super::removed::note(&mut tx, &removed).await?;
        tx.commit().await?;
        Ok((gone.rows_affected() > 0).then_some(removed))
    }
}

/// One series as it is in this connection's transaction.
pub(super) async fn one(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
) -> Result<Option<SeriesRecord>> {
    let row = sqlx::query(select_series!("WHERE s.series_uid = $1"))
        .bind(uid.as_str())
        .fetch_optional(connection)
        .await?;
    row.as_ref().map(rows::series).transpose()
}

/// Identity of the set of instances of the series' latest complete revision.
pub(super) async fn complete_set(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
) -> Result<Option<[u8; 32]>> {
    let row = sqlx::query(
        "SELECT instances_sha256 FROM series WHERE series_uid = $1 AND instances_sha256 IS NOT NULL",
    )
    .bind(uid.as_str())
    .fetch_optional(connection)
    .await?;
    Ok(row.map(|row| rows::sha256(&row, "instances_sha256")).transpose()?)
}

/// `created_ms:uid`, in hex: where the next page begins.
fn parse_cursor(cursor: &str) -> Result<(i64, String)> {
    let parsed = hex::decode(cursor).ok().and_then(|bytes| String::from_utf8(bytes).ok()).and_then(|text| {
        let (ms, uid) = text.split_once(':')?;
        Some((ms.parse().ok()?, uid.to_owned()))
    });
    parsed.ok_or_else(invalid_cursor)
}

pub(super) fn invalid_cursor() -> Error {
    Error::InvalidParameter {
        name: "cursor".into(),
        detail: "not one of ours; take it from the previous page, or leave it out".into(),
    }
}
