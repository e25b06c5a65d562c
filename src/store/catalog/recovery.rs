//! Rows for blobs that have none: after a crash between file and row, after a catalog was lost.

use sqlx::Row as _;

use super::dialect::Connection;
use super::dump::{self, Columns};
use super::instances::{NewInstance, find, insert, set_sha256, upsert_series};
use super::{Catalog, corrections, generation, restoring, rows, schema, series, transfers};
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::Result;
use crate::store::records::{InstanceRecord, ReconstructionId};
use crate::store::recovery::ResultRecord;

/// What became of a blob without a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Found {
    /// It has one now.
    Entered,
    /// The row of its instance named a blob that is gone; it names this one now, with the same
    /// data set.
    Repaired,
    /// The row of its instance told of an earlier data set of the same image; it tells of this one now.
    Corrected,
    /// It can't have one: why.
    Refused(&'static str),
}

impl Catalog {
    /// Enters an instance whose blob has no row. Its series is receiving then, due when the service
    /// next starts its timers, and in doubt: nobody said that it is whole. `written_ms` tells when a
    /// blob was written; `None`: it is gone.
    pub(crate) async fn enter_found(
        &self,
        new: &NewInstance,
        modified_ms: i64,
        written_ms: impl Fn(&str) -> Option<i64>,
    ) -> Result<Found> {
        let mut tx = self.begin().await?;
        if let Some(row) = find(&mut tx, &new.header.sop_instance_uid).await? {
            let former_ms = written_ms(&row.blob);
            let found = found_again(&mut tx, &row, former_ms, new, modified_ms).await?;
            tx.commit().await?;
            return Ok(found);
        }
        let uid = &new.header.series_instance_uid;
        let before = series::one(&mut tx, uid).await?;
        if before.is_some_and(|series| series.study_instance_uid != new.header.study_instance_uid) {
            return Ok(Found::Refused("its series belongs to another study"));
        }
        upsert_series(&mut tx, new, modified_ms).await?;
        insert(&mut tx, new, modified_ms).await?;
        transfers::doubt(&mut tx, uid).await?;
        sqlx::query(
            "UPDATE series SET created_ms = (SELECT MIN(received_ms) FROM instances WHERE series_uid = $1), \
             updated_ms = (SELECT MAX(received_ms) FROM instances WHERE series_uid = $1) WHERE series_uid = $1",
        )
        .bind(uid.as_str())
        .execute(&mut *tx)
        .await?;
        tx.commit().await?;
        Ok(Found::Entered)
    }

    /// Enters a result whose reconstruction has no row, its series too if that has none.
    pub(crate) async fn enter_result(&self, record: &ResultRecord, prefix: &str) -> Result<Found> {
        let mut tx = self.begin().await?;
        let text = |name: &str| record.reconstruction.get(name).and_then(|value| value.as_str());
        let (Some(id), Some(uid)) = (text("id"), text("series_uid")) else {
            return Ok(Found::Refused("its record names no reconstruction and series"));
        };
        let (Ok(_), Ok(uid)) = (id.parse::<ReconstructionId>(), uid.parse::<SeriesInstanceUid>()) else {
            return Ok(Found::Refused("its record names no reconstruction and series"));
        };
        let known = sqlx::query("SELECT id FROM reconstructions WHERE id = $1")
            .bind(id)
            .fetch_optional(&mut *tx)
            .await?;
        if known.is_some() {
            return Ok(Found::Refused("its reconstruction has another result, or none yet"));
        }
        if series::one(&mut tx, &uid).await?.is_none() {
            let mut row = record.series.clone();
            row.extend([("instances".into(), 0.into()), ("bytes".into(), 0.into())]);
            row.extend([("due_ms".into(), ().into()), ("due_reason".into(), ().into())]);
            dump::insert(&mut tx, "series", &row).await?;
        }
        let mut row = record.reconstruction.clone();
        row.insert("result".into(), prefix.into());
        row.insert("superseded_by".into(), ().into());
        if row.get("state").is_some_and(|state| state == "superseded") {
            row.insert("state".into(), "succeeded".into());
        }
        if dump::insert(&mut tx, "reconstructions", &row).await.is_err() {
            return Ok(Found::Refused("its record can't be entered"));
        }
        restore_revision(&mut tx, &uid, id, record).await?;
        restoring::completeness(&mut tx, &uid, record).await?;
        tx.commit().await?;
        Ok(Found::Entered)
    }

    /// Points the row of an instance to a new blob with the same data set.
    pub(crate) async fn replace_blob(&self, new: &NewInstance) -> Result<bool> {
        let mut tx = self.begin().await?;
        let Some(row) = find(&mut tx, &new.header.sop_instance_uid).await? else { return Ok(false) };
        if row.data_set_sha256 != new.data_set_sha256 {
            return Ok(false);
        }
        point_to(&mut tx, new).await?;
        let former = super::Removed { blobs: vec![row.blob], results: Vec::new() };
        super::removed::note(&mut tx, &former).await?;
        tx.commit().await?;
        Ok(true)
    }

    /// Whether nothing at all is entered.
    pub(crate) async fn is_empty(&self) -> Result<bool> {
        let series: i64 = sqlx::query_scalar("SELECT COUNT(*) FROM series").fetch_one(&self.readers).await?;
        Ok(series == 0)
    }

    /// Identity of the set of all instances that are stored of a series, and how many they are.
    pub(crate) async fn stored_set(&self, uid: &SeriesInstanceUid) -> Result<([u8; 32], u64)> {
        let instances = self.instances(uid).await?;
        Ok((set_sha256(&instances), instances.len() as u64))
    }

    /// Whether there is a reconstruction of this set of instances with these parameters.
    pub(crate) async fn has_reconstruction(
        &self,
        uid: &SeriesInstanceUid,
        set: &[u8; 32],
        parameters: &[u8; 32],
    ) -> Result<bool> {
        let rows: i64 = sqlx::query_scalar(
            "SELECT COUNT(*) FROM reconstructions \
             WHERE series_uid = $1 AND instances_sha256 = $2 AND parameters_sha256 = $3",
        )
        .bind(uid.as_str())
        .bind(set.as_slice())
        .bind(parameters.as_slice())
        .fetch_one(&self.readers)
        .await?;
        Ok(rows > 0)
    }

    /// How many series and reconstructions there are.
    pub(crate) async fn counts(&self) -> Result<(i64, i64)> {
        let series = sqlx::query_scalar("SELECT COUNT(*) FROM series").fetch_one(&self.readers).await?;
        let reconstructions =
            sqlx::query_scalar("SELECT COUNT(*) FROM reconstructions").fetch_one(&self.readers).await?;
        Ok((series, reconstructions))
    }

    /// Writes everything into the database's own file.
    pub(crate) async fn checkpoint(&self) -> Result<()> {
        generation::checkpoint(&mut *self.writer.acquire().await?).await?;
        Ok(())
    }
}

/// What becomes of a blob whose instance has a row that names another one, written at `former_ms` unless it is
/// gone. A correction removes the former blob and says of which image it is: one that a catalog from a backup
/// does not know is found by that, and is not lost for it.
async fn found_again(
    connection: &mut Connection,
    row: &InstanceRecord,
    former_ms: Option<i64>,
    new: &NewInstance,
    modified_ms: i64,
) -> Result<Found> {
    if former_ms.is_none() && row.data_set_sha256 == new.data_set_sha256 {
        point_to(connection, new).await?;
        return Ok(Found::Repaired);
    }
    let (there, here) = (&row.header, &new.header);
    let is_of_the_image = row.data_set_sha256 != new.data_set_sha256
        && row.image_sha256 == new.image_sha256.unwrap_or(new.data_set_sha256)
        && there.series_instance_uid == here.series_instance_uid
        && there.study_instance_uid == here.study_instance_uid;
    if is_of_the_image && former_ms.is_none_or(|former_ms| former_ms < modified_ms) {
        corrections::enter_found(connection, row, new, modified_ms).await?;
        return Ok(Found::Corrected);
    }
    if former_ms.is_some() {
        return Ok(Found::Refused("another copy of an instance that is stored"));
    }
    transfers::doubt(connection, &there.series_instance_uid).await?;
    Ok(Found::Refused(
        "another image than that of the instance's row, whose own file is missing: remove the series and send it again",
    ))
}

async fn point_to(connection: &mut Connection, new: &NewInstance) -> Result<()> {
    sqlx::query("UPDATE instances SET blob = $2, size = $3 WHERE sop_uid = $1")
        .bind(new.header.sop_instance_uid.as_str())
        .bind(new.blob.as_str())
        .bind(super::instances::signed(new.size))
        .execute(connection)
        .await?;
    Ok(())
}

/// The series and its instances know the revision that the result was made from.
async fn restore_revision(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    id: &str,
    record: &ResultRecord,
) -> Result<()> {
    sqlx::query(
        "UPDATE series SET revision = (SELECT revision FROM reconstructions WHERE id = $2), \
         instances_sha256 = (SELECT instances_sha256 FROM reconstructions WHERE id = $2) \
         WHERE series_uid = $1 AND revision < (SELECT revision FROM reconstructions WHERE id = $2)",
    )
    .bind(uid.as_str())
    .bind(id)
    .execute(&mut *connection)
    .await?;
    for instance in &record.instances {
        sqlx::query(
            "UPDATE instances SET revision = (SELECT revision FROM reconstructions WHERE id = $3) \
             WHERE sop_uid = $1 AND series_uid = $2 AND (revision IS NULL \
             OR revision > (SELECT revision FROM reconstructions WHERE id = $3))",
        )
        .bind(instance)
        .bind(uid.as_str())
        .bind(id)
        .execute(&mut *connection)
        .await?;
    }
    Ok(())
}

/// What a result needs to get its row back: the rows of its reconstruction and series as they are
/// in this transaction, and the instances that it was made from.
pub(super) async fn record(connection: &mut Connection, id: ReconstructionId) -> Result<ResultRecord> {
    let row = sqlx::query("SELECT * FROM reconstructions WHERE id = $1")
        .bind(id.to_string())
        .fetch_one(&mut *connection)
        .await?;
    let uid: String = row.try_get("series_uid")?;
    let revision: i64 = rows::number(&row, "revision")?;
    let series = sqlx::query("SELECT * FROM series WHERE series_uid = $1")
        .bind(&uid)
        .fetch_one(&mut *connection)
        .await?;
    let instances: Vec<String> = sqlx::query_scalar(
        "SELECT sop_uid FROM instances WHERE series_uid = $1 AND revision <= $2 ORDER BY sop_uid",
    )
    .bind(&uid)
    .bind(revision)
    .fetch_all(&mut *connection)
    .await?;
    let choices = sqlx::query("SELECT * FROM clinical_choices WHERE series_uid = $1 ORDER BY chosen_ms")
        .bind(&uid)
        .fetch_all(&mut *connection)
        .await?;
    let refused = sqlx::query("SELECT * FROM refused WHERE series_uid = $1 ORDER BY sop_uid, code")
        .bind(&uid)
        .fetch_all(&mut *connection)
        .await?;
    let attribute_changes =
        sqlx::query("SELECT * FROM attribute_changes WHERE series_uid = $1 ORDER BY changed_ms")
            .bind(&uid)
            .fetch_all(&mut *connection)
            .await?;
    let expected_instances =
        sqlx::query_scalar("SELECT expected_instances FROM expectations WHERE series_uid = $1")
            .bind(&uid)
            .fetch_optional(connection)
            .await?;
    let (reconstruction, series): (Columns, Columns) = (dump::columns(&row)?, dump::columns(&series)?);
    let choices = choices.iter().map(dump::columns).collect::<Result<_>>()?;
    let refused = refused.iter().map(dump::columns).collect::<Result<_>>()?;
    let attribute_changes = attribute_changes.iter().map(dump::columns).collect::<Result<_>>()?;
    let mut record = ResultRecord::new(schema::latest(), reconstruction, series, instances);
    record.expected_instances = expected_instances;
    record.choices = choices;
    record.refused = refused;
    record.attribute_changes = attribute_changes;
    Ok(record)
}
