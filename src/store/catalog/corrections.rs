//! Corrected attributes and identities: an instance that is stored, with the same pixels and geometry, came again
//! with another identity. Its row then names the new data set; the series' identity is changing until
//! every instance carries the new one.
//!
//! A change of identity is a round, which the series counts. An instance that was replaced, that came
//! new or that was sent again as it is stored in that round is confirmed. The change is over when every
//! other instance has the identity of a confirmed one, and all can be of one patient.

use super::completion::Policy;
use super::dialect::Connection;
use super::instances::{NewInstance, signed};
use super::removed::{self, Removed};
use super::transfers::{self, OpenSender};
use super::{Catalog, now_ms, queue, rows, senders};
use crate::dicom::identity::IdentityField;
use crate::dicom::identity::{Identity, parted};
use crate::dicom::uid::{SeriesInstanceUid, SopInstanceUid};
use crate::error::Result;
use crate::store::records::{AttributeChange, IdentityChange, InstanceRecord};

/// What a confirmed instance did to its series.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Settled {
    /// What of the identity has changed, if the change is over now.
    pub(crate) changed: Option<Vec<IdentityField>>,
    /// A reconstruction waits again: it had failed for two patients in the series.
    pub(crate) queued: bool,
}

impl Catalog {
    /// Gives the stored instance the new data set and its identity, of which `fields` have changed, or else
    /// other attributes have; keeps the key of the former blob until nobody reads it. `None`: the row is no longer as `stored` has it, nothing changed.
    pub(crate) async fn correct(
        &self,
        stored: &InstanceRecord,
        fields: &[IdentityField],
        new: &NewInstance,
        sender: &OpenSender,
        policy: &Policy,
    ) -> Result<Option<Settled>> {
        let (uid, now) = (&new.header.series_instance_uid, now_ms());
        let mut tx = self.begin().await?;
        if !replace(&mut tx, stored, new).await? {
            return Ok(None);
        }
        sqlx::query("INSERT INTO replaced_blobs (blob, series_uid) VALUES ($1, $2)")
            .bind(stored.blob.as_str())
            .bind(uid.as_str())
            .execute(&mut *tx)
            .await?;
        let settled = tell(&mut tx, stored, fields, new, now, policy.quiet_ms).await?;
        senders::heard(&mut tx, uid, sender, &self.process, policy).await?;
        transfers::brought(&mut tx, uid, &new.header.sop_instance_uid, sender.id, false).await?;
        tx.commit().await?;
        Ok(Some(settled))
    }

    /// The corrections of other attributes of a series than its identity, the first one first.
    pub(crate) async fn attribute_changes(&self, uid: &SeriesInstanceUid) -> Result<Vec<AttributeChange>> {
        let found: Vec<(i64, i64)> = sqlx::query_as(
            "SELECT instances, changed_ms FROM attribute_changes WHERE series_uid = $1 ORDER BY changed_ms",
        )
        .bind(uid.as_str())
        .fetch_all(&self.readers)
        .await?;
        let change = |(instances, changed_ms): (i64, i64)| AttributeChange {
            instances: instances.unsigned_abs(),
            changed_ms,
        };
        Ok(found.into_iter().map(change).collect())
    }

    /// Instances of the series whose identity an earlier version did not read, and their blobs.
    pub(crate) async fn without_identity(&self, uid: &SeriesInstanceUid) -> Result<Vec<(String, String)>> {
        let found =
            sqlx::query_as("SELECT sop_uid, blob FROM instances WHERE series_uid = $1 AND NOT has_identity")
                .bind(uid.as_str())
                .fetch_all(&self.readers)
                .await?;
        Ok(found)
    }

    /// Enters identities that were read from those blobs.
    pub(crate) async fn enter_identities(&self, read: &[(String, Identity)]) -> Result<()> {
        let mut tx = self.begin().await?;
        for (blob, identity) in read {
            sqlx::query(
                "UPDATE instances SET has_identity = TRUE, patient_id = $2, issuer_of_patient_id = $3, patient_name = $4, \
                 patient_birth_date = $5, patient_sex = $6, accession_number = $7 WHERE blob = $1",
            )
            .bind(blob.as_str())
            .bind(identity.patient_id.as_deref())
            .bind(identity.issuer_of_patient_id.as_deref())
            .bind(identity.patient_name.as_deref())
            .bind(identity.patient_birth_date.as_deref())
            .bind(identity.patient_sex.as_deref())
            .bind(identity.accession_number.as_deref())
            .execute(&mut *tx)
            .await?;
        }
        Ok(tx.commit().await?)
    }

    /// The changes of identity of a series that are over, the first one first.
    pub(crate) async fn identity_changes(&self, uid: &SeriesInstanceUid) -> Result<Vec<IdentityChange>> {
        let found: Vec<(String, i64)> = sqlx::query_as(
            "SELECT fields, changed_ms FROM identity_changes WHERE series_uid = $1 ORDER BY round",
        )
        .bind(uid.as_str())
        .fetch_all(&self.readers)
        .await?;
        let change =
            |(fields, changed_ms): (String, i64)| IdentityChange { fields: parsed(&fields), changed_ms };
        Ok(found.into_iter().map(change).collect())
    }

    /// How many series have an identity that is changing.
    pub(crate) async fn identities_changing(&self) -> Result<u64> {
        let series: i64 =
            sqlx::query_scalar("SELECT COUNT(*) FROM series WHERE identity_changing IS NOT NULL")
                .fetch_one(&self.readers)
                .await?;
        Ok(series.unsigned_abs())
    }

    /// Replaced blobs that nobody reads: `at_start` all, else those of series without a reconstruction
    /// that runs.
    pub(crate) async fn replaced_blobs(&self, at_start: bool) -> Result<Vec<String>> {
        Ok(sqlx::query_scalar(
            "SELECT blob FROM replaced_blobs WHERE $1 OR NOT EXISTS (SELECT 1 FROM reconstructions r \
             WHERE r.series_uid = replaced_blobs.series_uid AND r.state = 'running')",
        )
        .bind(at_start)
        .fetch_all(&self.readers)
        .await?)
    }

    /// Forgets replaced blobs that were removed.
    pub(crate) async fn forget_replaced(&self, blobs: &[String]) -> Result<()> {
        let mut tx = self.begin().await?;
        for blob in blobs {
            sqlx::query("DELETE FROM replaced_blobs WHERE blob = $1").bind(blob).execute(&mut *tx).await?;
        }
        Ok(tx.commit().await?)
    }
}

/// The series has the description that all its instances have, if they have one.
const DESCRIBE: &str = "UPDATE series SET description = (SELECT MIN(description) FROM instances i \
                        WHERE i.series_uid = $1) WHERE series_uid = $1 AND 1 = (SELECT COUNT(DISTINCT \
                        COALESCE(description, '')) FROM instances i WHERE i.series_uid = $1)";

/// The series learns of the data set that took the place of `stored`.
async fn tell(
    connection: &mut Connection,
    stored: &InstanceRecord,
    fields: &[IdentityField],
    new: &NewInstance,
    now: i64,
    quiet_ms: i64,
) -> Result<Settled> {
    let uid = &new.header.series_instance_uid;
    sqlx::query(
        "UPDATE series SET bytes = bytes - $2 + $3, \
         updated_ms = CASE WHEN updated_ms < $4 THEN $4 ELSE updated_ms END WHERE series_uid = $1",
    )
    .bind(uid.as_str())
    .bind(signed(stored.size))
    .bind(signed(new.size))
    .bind(now)
    .execute(&mut *connection)
    .await?;
    sqlx::query(DESCRIBE).bind(uid.as_str()).execute(&mut *connection).await?;
    if fields.is_empty() {
        note_attributes(connection, uid, now, quiet_ms).await?;
    } else {
        begin_change(connection, uid, fields).await?;
    }
    confirm(connection, uid, &new.header.sop_instance_uid, now).await
}

/// A correction that the catalog does not know and whose file was found, written at `modified_ms`: the row
/// takes it. Files come the latest first: those of one start are one correction of attributes.
pub(super) async fn enter_found(
    connection: &mut Connection,
    stored: &InstanceRecord,
    new: &NewInstance,
    modified_ms: i64,
) -> Result<()> {
    replace(connection, stored, new).await?;
    let former = Removed { blobs: vec![stored.blob.clone()], results: Vec::new() };
    removed::note(connection, &former).await?;
    let fields = stored.header.identity.changed(&new.header.identity);
    tell(connection, stored, &fields, new, modified_ms, 0).await?;
    Ok(())
}

/// These parts of the identity of an instance have changed: the series' identity is changing.
async fn begin_change(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    fields: &[IdentityField],
) -> Result<()> {
    let changing = changing(connection, uid).await?;
    let mut all = changing.fields.clone().unwrap_or_default();
    all.extend(fields);
    all.sort_unstable();
    all.dedup();
    let round = if changing.fields.is_some() { changing.round } else { changing.round + 1 };
    sqlx::query("UPDATE series SET identity_round = $2, identity_changing = $3 WHERE series_uid = $1")
        .bind(uid.as_str())
        .bind(round)
        .bind(joined(&all))
        .execute(connection)
        .await?;
    Ok(())
}

/// Other attributes of an instance have changed: with what came within the quiet time before it is one
/// correction.
async fn note_attributes(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    now: i64,
    quiet_ms: i64,
) -> Result<()> {
    let same = sqlx::query(
        "UPDATE attribute_changes SET instances = instances + 1, \
         changed_ms = CASE WHEN changed_ms < $2 THEN $2 ELSE changed_ms END WHERE series_uid = $1 \
         AND changed_ms = (SELECT MAX(changed_ms) FROM attribute_changes l WHERE l.series_uid = $1) \
         AND changed_ms >= $3",
    )
    .bind(uid.as_str())
    .bind(now)
    .bind(now - quiet_ms)
    .execute(&mut *connection)
    .await?;
    if same.rows_affected() == 0 {
        sqlx::query("INSERT INTO attribute_changes (series_uid, instances, changed_ms) VALUES ($1, 1, $2)")
            .bind(uid.as_str())
            .bind(now)
            .execute(connection)
            .await?;
    }
    Ok(())
}

/// Where a series' identity stands.
struct Changing {
    round: i64,
    /// While it changes, what has.
    fields: Option<Vec<IdentityField>>,
}

async fn changing(connection: &mut Connection, uid: &SeriesInstanceUid) -> Result<Changing> {
    let row: Option<(i64, Option<String>)> =
        sqlx::query_as("SELECT identity_round, identity_changing FROM series WHERE series_uid = $1")
            .bind(uid.as_str())
            .fetch_optional(connection)
            .await?;
    let (round, fields) = row.unwrap_or_default();
    Ok(Changing { round, fields: fields.map(|fields| parsed(&fields)) })
}

/// The row takes the new data set, if it still is as `stored` has it.
async fn replace(connection: &mut Connection, stored: &InstanceRecord, new: &NewInstance) -> Result<bool> {
    let (header, identity) = (&new.header, &new.header.identity);
    let done = sqlx::query(
        "UPDATE instances SET blob = $3, size = $4, data_set_sha256 = $5, image_sha256 = $6, transfer_syntax_uid = $7, \
         modality = $8, image_type = $9, description = $10, photometric = $11, samples_per_pixel = $12, \
         has_position = $13, has_identity = TRUE, patient_id = $14, issuer_of_patient_id = $15, patient_name = $16, \
         patient_birth_date = $17, patient_sex = $18, accession_number = $19 WHERE sop_uid = $1 AND blob = $2",
    )
    .bind(header.sop_instance_uid.as_str())
    .bind(stored.blob.as_str())
    .bind(new.blob.as_str())
    .bind(signed(new.size))
    .bind(new.data_set_sha256.as_slice())
    .bind(stored.image_sha256.as_slice())
    .bind(header.transfer_syntax_uid.as_str())
    .bind(header.modality.as_deref())
    .bind(header.image_type.join("\\"))
    .bind(header.series_description.as_deref())
    .bind(header.photometric.as_deref())
    .bind(header.samples_per_pixel.map(i64::from))
    .bind(header.has_position)
    .bind(identity.patient_id.as_deref())
    .bind(identity.issuer_of_patient_id.as_deref())
    .bind(identity.patient_name.as_deref())
    .bind(identity.patient_birth_date.as_deref())
    .bind(identity.patient_sex.as_deref())
    .bind(identity.accession_number.as_deref())
    .execute(connection)
    .await?;
    Ok(done.rows_affected() == 1)
}

/// An instance came as it is stored now. If its series' identity is changing, it is confirmed, and the
/// change may be over.
pub(super) async fn confirm(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    instance: &SopInstanceUid,
    now: i64,
) -> Result<Settled> {
    let Changing { round, fields: Some(fields) } = changing(connection, uid).await? else {
        return Ok(Settled::default());
    };
    sqlx::query("UPDATE instances SET identity_round = $2 WHERE sop_uid = $1")
        .bind(instance.as_str())
        .bind(round)
        .execute(&mut *connection)
        .await?;
    let Some((patient_id, accession_number)) = settled(connection, uid, round).await? else {
        return Ok(Settled::default());
    };
    sqlx::query(
        "UPDATE series SET identity_changing = NULL, patient_id = $2, accession_number = $3 WHERE series_uid = $1",
    )
    .bind(uid.as_str())
    .bind(patient_id)
    .bind(accession_number)
    .execute(&mut *connection)
    .await?;
    sqlx::query(
        "INSERT INTO identity_changes (series_uid, round, fields, changed_ms) VALUES ($1, $2, $3, $4)",
    )
    .bind(uid.as_str())
    .bind(round)
    .bind(joined(&fields))
    .bind(now)
    .execute(&mut *connection)
    .await?;
    // What failed for two patients in the series is one patient's now.
    let failed: Vec<String> = sqlx::query_scalar(
        "SELECT r.id FROM reconstructions r JOIN series s ON s.series_uid = r.series_uid \
         WHERE r.series_uid = $1 AND r.revision = s.revision AND r.state = 'failed' AND r.error_code = 'mixed_patient'",
    )
    .bind(uid.as_str())
    .fetch_all(&mut *connection)
    .await?;
    let queued = !failed.is_empty();
    for id in failed.iter().filter_map(|id| id.parse().ok()) {
        queue::queue_again(connection, id, now).await?;
    }
    Ok(Settled { changed: Some(fields), queued })
}

/// Patient ID and Accession Number that the series has once the change of its identity is over; `None`
/// while it is not.
async fn settled(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    round: i64,
) -> Result<Option<(Option<String>, Option<String>)>> {
    let found = sqlx::query(
        "SELECT DISTINCT patient_id, issuer_of_patient_id, patient_name, patient_birth_date, patient_sex, \
         accession_number, has_identity, CASE WHEN identity_round = $2 THEN 1 ELSE 0 END AS confirmed \
         FROM instances WHERE series_uid = $1",
    )
    .bind(uid.as_str())
    .bind(round)
    .fetch_all(connection)
    .await?;
    let (mut confirmed, mut others, mut is_known) = (Vec::new(), Vec::new(), true);
    for row in &found {
        let identity = rows::identity(row)?;
        is_known &= rows::flag(row, "has_identity")?;
        let is_confirmed: i64 = rows::number(row, "confirmed")?;
        if is_confirmed == 1 { confirmed.push(identity) } else { others.push(identity) }
    }
    let all: Vec<&Identity> = confirmed.iter().chain(&others).collect();
    let is_over = is_known && others.iter().all(|one| confirmed.contains(one)) && parted(&all).is_none();
    Ok(is_over.then(|| {
        let common = |field| common(all.iter().map(|identity| identity.get(field)));
        (common(IdentityField::PatientId), common(IdentityField::AccessionNumber))
    }))
}

/// The one value that stands in some of them; `None` if there are several.
pub(super) fn common<'a>(values: impl Iterator<Item = Option<&'a str>>) -> Option<String> {
    let mut values: Vec<&str> = values.flatten().collect();
    values.sort_unstable();
    values.dedup();
    match values[..] {
        [one] => Some(one.to_owned()),
        _ => None,
    }
}

fn joined(fields: &[IdentityField]) -> String {
    let names: Vec<&str> = fields.iter().map(|field| field.name()).collect();
    names.join(",")
}

fn parsed(fields: &str) -> Vec<IdentityField> {
    fields.split(',').filter_map(IdentityField::from_name).collect()
}
