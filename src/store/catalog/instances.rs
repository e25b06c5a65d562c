//! Instances: what is stored, what was refused, and the transaction that enters a new one.

use super::completion::{Completion, Policy, complete};
use super::dialect::Connection;
use super::transfers::{self, OpenSender};
use super::{Catalog, corrections, now_ms, rows, senders, series};
use crate::dicom::header::InstanceHeader;
use crate::dicom::uid::{SeriesInstanceUid, SopInstanceUid, StudyInstanceUid};
use crate::error::{Error, Result};
use crate::store::records::{CompleteReason, InstanceRecord, Refused};
use sha2::{Digest as _, Sha256};

/// The code of a refusal of what is no slice: nothing lacks without it.
const NO_SLICE: &str = "unsupported-sop-class";

/// An instance whose bytes are durable and that has no row yet.
#[derive(Debug, Clone)]
pub(crate) struct NewInstance {
    pub(crate) header: InstanceHeader,
    pub(crate) blob: String,
    pub(crate) size: u64,
    pub(crate) data_set_sha256: [u8; 32],
    /// That of the data set that was stored first, where this one has a corrected identity.
    pub(crate) image_sha256: Option<[u8; 32]>,
}

/// What became of a [`NewInstance`].
#[derive(Debug)]
pub(crate) enum Added {
    /// It has a row now; it may have been the last one that was expected.
    New(Option<Completion>),
    /// There was one with its UID; nothing changed.
    Exists(Box<InstanceRecord>),
}

impl Catalog {
    /// Enters an instance and moves its series' deadline, all or nothing.
    ///
    /// # Errors
    /// The series belongs to another study; it holds as many instances as it may.
    pub(crate) async fn add_instance(
        &self,
        new: &NewInstance,
        sender: &OpenSender,
        policy: &Policy,
    ) -> Result<Added> {
        let now = now_ms();
        let uid = &new.header.series_instance_uid;
        let mut tx = self.begin().await?;
        if let Some(existing) = find(&mut tx, &new.header.sop_instance_uid).await? {
            return Ok(Added::Exists(Box::new(existing)));
        }
        let before = series::one(&mut tx, uid).await?;
        if let Some(before) = &before {
            if before.study_instance_uid != new.header.study_instance_uid {
                return Err(Error::ConflictingStudy(uid.clone()));
            }
            if before.instances >= policy.max_series_instances {
                return Err(Error::SeriesFull {
                    limit: policy.max_series_instances,
                    setting: "intake.max_series_instances",
                });
            }
        }
        upsert_series(&mut tx, new, now).await?;
        insert(&mut tx, new, now).await?;
        corrections::confirm(&mut tx, uid, &new.header.sop_instance_uid, now).await?;
        senders::heard(&mut tx, uid, sender, &self.process, policy).await?;
        transfers::brought(&mut tx, uid, &new.header.sop_instance_uid, sender.id, true).await?;

        let instances = before.as_ref().map_or(0, |series| series.instances) + 1;
        // Exactly: one more than expected shows that the number was wrong, and the quiet times count.
        let whole = senders::expected(&mut tx, uid).await? == Some(instances);
        let completion = if whole {
            Some(complete(&mut tx, uid, CompleteReason::ExpectedInstances, policy, now).await?)
        } else {
            None
        };
        tx.commit().await?;
        Ok(Added::New(completion))
    }

    /// The stored instance of that UID.
    pub(crate) async fn instance(&self, uid: &SopInstanceUid) -> Result<Option<InstanceRecord>> {
        find(&mut *self.readers.acquire().await?, uid).await
    }

    /// All instances of a series, by SOP Instance UID.
    pub(crate) async fn instances(&self, uid: &SeriesInstanceUid) -> Result<Vec<InstanceRecord>> {
        let found = sqlx::query("SELECT * FROM instances WHERE series_uid = $1 ORDER BY sop_uid")
            .bind(uid.as_str())
            .fetch_all(&self.readers)
            .await?;
        Ok(found.iter().map(rows::instance).collect::<Result<_, _>>()?)
    }

    /// Those that belonged to a revision of the series.
    pub(crate) async fn instances_of_revision(
        &self,
        uid: &SeriesInstanceUid,
        revision: u32,
    ) -> Result<Vec<InstanceRecord>> {
        let found =
            sqlx::query("SELECT * FROM instances WHERE series_uid = $1 AND revision <= $2 ORDER BY sop_uid")
                .bind(uid.as_str())
                .bind(i64::from(revision))
                .fetch_all(&self.readers)
                .await?;
        Ok(found.iter().map(rows::instance).collect::<Result<_, _>>()?)
    }

    /// Keys of all blobs that a row names: instances, and prefixes of results.
    pub(crate) async fn named_blobs(&self) -> Result<(Vec<String>, Vec<String>)> {
        let instances = sqlx::query_scalar("SELECT blob FROM instances").fetch_all(&self.readers).await?;
        let results = sqlx::query_scalar("SELECT result FROM reconstructions WHERE result IS NOT NULL")
            .fetch_all(&self.readers)
            .await?;
        Ok((instances, results))
    }

    /// Counts a refusal, which is a doubt of the series, unless the instance is of a class that is no
    /// slice. `study`: the instance's own.
    pub(crate) async fn add_refused(
        &self,
        series: &SeriesInstanceUid,
        instance: &SopInstanceUid,
        code: &str,
        study: Option<&StudyInstanceUid>,
    ) -> Result<()> {
        let mut tx = self.begin().await?;
        refuse(&mut tx, series, instance, code, study).await?;
        Ok(tx.commit().await?)
    }

    /// Instances of a series that were refused, by SOP Instance UID.
    pub(crate) async fn refused(&self, uid: &SeriesInstanceUid) -> Result<Vec<Refused>> {
        let found = sqlx::query("SELECT * FROM refused WHERE series_uid = $1 ORDER BY sop_uid, code")
            .bind(uid.as_str())
            .fetch_all(&self.readers)
            .await?;
        Ok(found.iter().map(rows::refused).collect::<Result<_, _>>()?)
    }
}

/// See [`Catalog::add_refused`].
pub(super) async fn refuse(
    connection: &mut Connection,
    series: &SeriesInstanceUid,
    instance: &SopInstanceUid,
    code: &str,
    study: Option<&StudyInstanceUid>,
) -> Result<()> {
    sqlx::query(
        "INSERT INTO refused (series_uid, sop_uid, code, times, last_ms, held, study_uid) \
         VALUES ($1, $2, $3, 1, $4, $5, $6) \
         ON CONFLICT (series_uid, sop_uid, code) DO UPDATE SET times = refused.times + 1, \
         last_ms = excluded.last_ms, held = excluded.held, study_uid = excluded.study_uid",
    )
    .bind(series.as_str())
    .bind(instance.as_str())
    .bind(code)
    .bind(now_ms())
    .bind(code != NO_SLICE)
    .bind(study.map(|study| study.as_str()))
    .execute(&mut *connection)
    .await?;
    transfers::refresh(connection, series).await
}

pub(super) async fn find(
    connection: &mut Connection,
    uid: &SopInstanceUid,
) -> Result<Option<InstanceRecord>> {
    let row = sqlx::query("SELECT * FROM instances WHERE sop_uid = $1")
        .bind(uid.as_str())
        .fetch_optional(connection)
        .await?;
    Ok(row.as_ref().map(rows::instance).transpose()?)
}

/// Makes the series, or counts one instance more in it; either way it is receiving.
pub(super) async fn upsert_series(connection: &mut Connection, new: &NewInstance, now: i64) -> Result<()> {
    let header = &new.header;
    sqlx::query(
        "INSERT INTO series (series_uid, study_uid, frame_of_reference_uid, modality, description, patient_id, \
         accession_number, state, revision, instances, bytes, created_ms, updated_ms) \
         VALUES ($1, $2, $3, $4, $5, $6, $7, 'receiving', 0, 1, $8, $9, $9) \
         ON CONFLICT (series_uid) DO UPDATE SET state = 'receiving', unfit_reason = NULL, complete_reason = NULL, \
         instances = series.instances + 1, bytes = series.bytes + excluded.bytes, updated_ms = excluded.updated_ms",
    )
    .bind(header.series_instance_uid.as_str())
    .bind(header.study_instance_uid.as_str())
    .bind(header.frame_of_reference_uid.as_ref().map(|uid| uid.as_str()))
    .bind(header.modality.as_deref())
    .bind(header.series_description.as_deref())
    .bind(header.identity.patient_id.as_deref())
    .bind(header.identity.accession_number.as_deref())
    .bind(signed(new.size))
    .bind(now)
    .execute(connection)
    .await?;
    Ok(())
}

pub(super) async fn insert(connection: &mut Connection, new: &NewInstance, now: i64) -> Result<()> {
    let header = &new.header;
    sqlx::query(
        "INSERT INTO instances (sop_uid, series_uid, study_uid, sop_class_uid, transfer_syntax_uid, \
         frame_of_reference_uid, modality, image_type, description, patient_id, accession_number, frames, pixel_rows, \
         pixel_columns, has_pixel_data, blob, size, data_set_sha256, received_ms, photometric, samples_per_pixel, \
         has_position, has_identity, issuer_of_patient_id, patient_name, patient_birth_date, patient_sex, image_sha256) \
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14, $15, $16, $17, $18, $19, $20, $21, $22, \
         TRUE, $23, $24, $25, $26, $27)",
    )
    .bind(header.sop_instance_uid.as_str())
    .bind(header.series_instance_uid.as_str())
    .bind(header.study_instance_uid.as_str())
    .bind(header.sop_class_uid.as_str())
    .bind(header.transfer_syntax_uid.as_str())
    .bind(header.frame_of_reference_uid.as_ref().map(|uid| uid.as_str()))
    .bind(header.modality.as_deref())
    .bind(header.image_type.join("\\"))
    .bind(header.series_description.as_deref())
    .bind(header.identity.patient_id.as_deref())
    .bind(header.identity.accession_number.as_deref())
    .bind(i64::from(header.frames))
    .bind(header.rows.map(i64::from))
    .bind(header.columns.map(i64::from))
    .bind(header.has_pixel_data)
    .bind(new.blob.as_str())
    .bind(signed(new.size))
    .bind(new.data_set_sha256.as_slice())
    .bind(now)
    .bind(header.photometric.as_deref())
    .bind(header.samples_per_pixel.map(i64::from))
    .bind(header.has_position)
    .bind(header.identity.issuer_of_patient_id.as_deref())
    .bind(header.identity.patient_name.as_deref())
    .bind(header.identity.patient_birth_date.as_deref())
    .bind(header.identity.patient_sex.as_deref())
    .bind(new.image_sha256.as_ref().map(<[u8; 32]>::as_slice))
    .execute(connection)
    .await?;
    Ok(())
}

/// A count for a column of 64 bits with a sign.
pub(super) fn signed(value: u64) -> i64 {
    i64::try_from(value).unwrap_or(i64::MAX)
}

/// Identity of a set of instances: SHA-256 over SOP Instance UID, a zero byte and the image's
/// SHA-256 of each, in the order of the UIDs.
pub(crate) fn set_sha256(instances: &[InstanceRecord]) -> [u8; 32] {
    let mut sorted: Vec<_> =
        instances.iter().map(|i| (i.header.sop_instance_uid.as_str(), i.image_sha256)).collect();
    sorted.sort_unstable();
    let mut hash = Sha256::new();
    for (uid, data_set) in sorted {
        hash.update(uid.as_bytes());
        hash.update([0]);
        hash.update(data_set);
    }
    hash.finalize().into()
}
