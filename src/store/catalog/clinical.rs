//! Which reconstruction of a series is the clinical one.
//!
//! The service queues one itself for every revision (`queued_for`). An operator may choose another
//! (`chosen_for`: the revision at which that was); the choice holds until a later revision is complete.
//! So the clinical one is that of the highest revision, the chosen one before the service's own.

use sqlx::Row as _;

use super::dialect::{Connection, Transaction};
use super::dump::{self, Columns};
use super::{Catalog, now_ms, reconstructions, rows, series};
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::{Error, Result};
use crate::store::records::{Clinical, ClinicalChoice, ReconstructionId, ReconstructionRecord};

/// Of the rows of one series' reconstructions, the one that is served.
macro_rules! served {
    () => {
        "state IN ('succeeded', 'superseded') AND (queued_for IS NOT NULL OR chosen_for IS NOT NULL) \
         ORDER BY CASE WHEN COALESCE(chosen_for, -1) >= COALESCE(queued_for, -1) THEN 2 * chosen_for + 1 \
         ELSE 2 * queued_for END DESC, id DESC LIMIT 1"
    };
}
pub(super) use served;

/// A choice that is not committed yet.
#[derive(Debug)]
pub(crate) struct Chosen {
    pub(crate) tx: Transaction,
    /// Its row.
    pub(crate) choice: Columns,
    /// Prefixes of the results beside which it is written.
    pub(crate) results: Vec<String>,
}

impl Catalog {
    /// The one that is served; see `Store::clinical`.
    pub(crate) async fn clinical(&self, uid: &SeriesInstanceUid) -> Result<Option<Clinical>> {
        let row = sqlx::query(concat!("SELECT * FROM reconstructions WHERE series_uid = $1 AND ", served!()))
            .bind(uid.as_str())
            .fetch_optional(&self.readers)
            .await?;
        let Some(row) = row else { return Ok(None) };
        let queued_for: Option<i64> = row.try_get("queued_for")?;
        let chosen_for: Option<i64> = row.try_get("chosen_for")?;
        let reconstruction = rows::reconstruction(&row)?;
        let chosen = chosen_for.is_some() && chosen_for >= queued_for;
        Ok(Some(Clinical { reconstruction, chosen }))
    }

    /// The one of that revision that is clinical there, whatever its state.
    pub(crate) async fn clinical_at(
        &self,
        uid: &SeriesInstanceUid,
        revision: u32,
    ) -> Result<Option<ReconstructionRecord>> {
        let row = sqlx::query(
            "SELECT * FROM reconstructions WHERE series_uid = $1 \
             AND (queued_for = $2 OR (chosen_for = $2 AND revision = $2)) \
             ORDER BY CASE WHEN chosen_for = $2 THEN 0 ELSE 1 END, id DESC LIMIT 1",
        )
        .bind(uid.as_str())
        .bind(i64::from(revision))
        .fetch_optional(&self.readers)
        .await?;
        row.as_ref().map(rows::reconstruction).transpose()
    }

    /// See `Store::choose_clinical`.
    pub(crate) async fn choose_clinical(
        &self,
        uid: &SeriesInstanceUid,
        id: Option<ReconstructionId>,
        by: Option<&str>,
    ) -> Result<Chosen> {
        let mut tx = self.begin().await?;
        let Some(series) = series::one(&mut tx, uid).await? else {
            return Err(Error::NotFound { what: "series", id: uid.to_string() });
        };
        if let Some(id) = id {
            let record = reconstructions::one(&mut tx, id).await?;
            let Some(record) = record.filter(|record| record.series_instance_uid == *uid) else {
                return Err(Error::NotFound { what: "reconstruction of that series", id: id.to_string() });
            };
            if !record.state.has_cloud() {
                let detail = "only one that has a cloud can be the clinical one".to_owned();
                return Err(Error::ReconstructionState { state: record.state.name(), detail });
            }
        }
        let (revision, id) = (i64::from(series.revision), id.map(|id| id.to_string()));
        // Also beside the one that was chosen before: it must not be taken for chosen when the catalog
        // is made again without the other.
        let results: Vec<String> = sqlx::query_scalar(
            "SELECT result FROM reconstructions WHERE series_uid = $1 AND result IS NOT NULL \
             AND (id = $2 OR chosen_for = $3 OR queued_for = $3)",
        )
        .bind(uid.as_str())
        .bind(&id)
        .bind(revision)
        .fetch_all(&mut *tx)
        .await?;
        choose(&mut tx, uid.as_str(), revision, id.as_deref()).await?;
        let row = sqlx::query(
            "INSERT INTO clinical_choices (series_uid, revision, reconstruction_id, chosen_by, chosen_ms) \
             VALUES ($1, $2, $3, $4, $5) RETURNING *",
        )
        .bind(uid.as_str())
        .bind(revision)
        .bind(&id)
        .bind(by)
        .bind(now_ms())
        .fetch_one(&mut *tx)
        .await?;
        let choice = dump::columns(&row)?;
        Ok(Chosen { tx, choice, results })
    }

    /// What operators chose, oldest first.
    pub(crate) async fn clinical_choices(&self, uid: &SeriesInstanceUid) -> Result<Vec<ClinicalChoice>> {
        let found = sqlx::query("SELECT * FROM clinical_choices WHERE series_uid = $1 ORDER BY chosen_ms")
            .bind(uid.as_str())
            .fetch_all(&self.readers)
            .await?;
        Ok(found.iter().map(rows::clinical_choice).collect::<Result<_, sqlx::Error>>()?)
    }

    /// Series whose latest reconstruction of the service's own was made with a decoder at fault, and
    /// whose instances are still stored.
    pub(crate) async fn to_make_again(&self) -> Result<Vec<SeriesInstanceUid>> {
        let found: Vec<String> = sqlx::query_scalar(
            "SELECT DISTINCT series_uid FROM reconstructions old WHERE algorithm LIKE '%/0' \
             AND state = 'succeeded' AND queued_for IS NOT NULL AND EXISTS ( \
             SELECT 1 FROM instances i WHERE i.series_uid = old.series_uid) AND NOT EXISTS ( \
             SELECT 1 FROM reconstructions new WHERE new.series_uid = old.series_uid \
             AND new.queued_for >= old.queued_for AND new.algorithm NOT LIKE '%/0' \
             AND new.state NOT IN ('failed', 'cancelled')) ORDER BY series_uid",
        )
        .fetch_all(&self.readers)
        .await?;
        found.iter().map(|uid| uid.parse().map_err(Error::internal)).collect()
    }

    /// See `Store::take_for_clinical`.
    pub(crate) async fn take_for_clinical(&self, record: &ReconstructionRecord) -> Result<()> {
        let mut tx = self.begin().await?;
        queued_by_the_service(&mut tx, &record.series_instance_uid, record.id, record.revision).await?;
        Ok(tx.commit().await?)
    }
}

/// At that revision of the series it is the clinical one from now on; `None`: none is chosen.
pub(super) async fn choose(
    connection: &mut Connection,
    uid: &str,
    revision: i64,
    id: Option<&str>,
) -> Result<()> {
    sqlx::query("UPDATE reconstructions SET chosen_for = NULL WHERE series_uid = $1 AND chosen_for = $2")
        .bind(uid)
        .bind(revision)
        .execute(&mut *connection)
        .await?;
    sqlx::query("UPDATE reconstructions SET chosen_for = $2 WHERE id = $1 AND series_uid = $3")
        .bind(id)
        .bind(revision)
        .bind(uid)
        .execute(connection)
        .await?;
    Ok(())
}

/// The service queued `id` for that revision, or found it there. One that has the place keeps it
/// unless it gave nothing; one that a decoder at fault was used for (version 0) shares it, and is served
/// until the later one has succeeded.
pub(super) async fn queued_by_the_service(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    id: ReconstructionId,
    revision: u32,
) -> Result<()> {
    sqlx::query(
        "UPDATE reconstructions SET queued_for = NULL WHERE series_uid = $1 AND queued_for = $2 AND id <> $3 \
         AND state IN ('failed', 'cancelled')",
    )
    .bind(uid.as_str())
    .bind(i64::from(revision))
    .bind(id.to_string())
    .execute(&mut *connection)
    .await?;
    sqlx::query(
        "UPDATE reconstructions SET queued_for = $2 WHERE id = $3 AND NOT EXISTS ( \
         SELECT 1 FROM reconstructions other WHERE other.series_uid = $1 AND other.queued_for = $2 \
         AND other.algorithm NOT LIKE '%/0')",
    )
    .bind(uid.as_str())
    .bind(i64::from(revision))
    .bind(id.to_string())
    .execute(connection)
    .await?;
    Ok(())
}
