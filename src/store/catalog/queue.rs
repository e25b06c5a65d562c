//! The queue: which reconstructions wait, and who takes which. How a taken one ends is in
//! [`super::leases`].

use std::time::Duration;

use sqlx::Row as _;

use super::dialect::Connection;
use super::{Catalog, now_ms, reconstructions, rows, series, transfers};
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::{Error, Result};
use crate::pipeline::Parameters;
use crate::store::queue::{Claim, Lease};
use crate::store::records::{ReconstructionId, ReconstructionRecord, ReconstructionState, SeriesState};
use crate::store::stored::{identity_sha256, parameter_json, settings_sha256};

/// A reconstruction that is asked for.
pub(super) struct Wanted<'a> {
    pub(super) series: &'a SeriesInstanceUid,
    pub(super) revision: u32,
    pub(super) set: &'a [u8; 32],
    pub(super) instances: i64,
    pub(super) parameters: &'a Parameters,
    /// By the service itself: a clinical one.
    pub(super) own: bool,
}

/// What became of the wish.
pub(super) enum Enqueued {
    /// It waits for a worker now: new, or again after it had failed or been cancelled.
    Queued(ReconstructionId),
    /// It was there: queued, running or done.
    Existing(ReconstructionId),
    /// The queue is full.
    Full,
}

/// Of the rows of reconstructions, the clinical ones; they are run before what somebody tries.
macro_rules! clinical {
    () => {
        "(queued_for IS NOT NULL OR chosen_for IS NOT NULL)"
    };
}

impl Catalog {
    /// See `Store::enqueue`.
    pub(crate) async fn enqueue(
        &self,
        uid: &SeriesInstanceUid,
        parameters: &Parameters,
        own: bool,
        max_queued: u64,
    ) -> Result<(ReconstructionRecord, bool)> {
        let mut tx = self.begin().await?;
        let Some(record) = series::one(&mut tx, uid).await? else {
            return Err(Error::NotFound { what: "series", id: uid.to_string() });
        };
        let set = match (record.state, record.unfit_reason, series::complete_set(&mut tx, uid).await?) {
            (SeriesState::NotReconstructable, Some(reason), _) => {
                let reason = reason.name().to_owned();
                return Err(Error::NotReconstructable { uid: uid.clone(), reason, detail: None });
            }
            (SeriesState::Complete, _, Some(set)) => set,
            _ => return Err(Error::SeriesIncomplete(uid.clone())),
        };
        let wanted = Wanted {
            series: uid,
            revision: record.revision,
            set: &set,
            instances: super::instances::signed(record.instances),
            parameters,
            own,
        };
        let (id, queued) = match enqueue(&mut tx, &wanted, max_queued, now_ms()).await? {
            Enqueued::Queued(_) if record.instances == 0 => return Err(Error::SourceRemoved),
            Enqueued::Queued(id) => (id, true),
            Enqueued::Existing(id) => (id, false),
            Enqueued::Full => {
                return Err(Error::Busy("the queue of reconstructions is full (jobs.max_queued)"));
            }
        };
        transfers::refresh(&mut tx, uid).await?;
        let record = reconstructions::one(&mut tx, id).await?.ok_or(sqlx::Error::RowNotFound)?;
        tx.commit().await?;
        Ok((record, queued))
    }

    /// Queues a reconstruction again whose result, the one at `prefix`, is damaged. Returns it as it
    /// is then, and whether this call queued it: not if it has another result meanwhile.
    pub(crate) async fn remake(
        &self,
        id: ReconstructionId,
        prefix: &str,
        max_queued: u64,
    ) -> Result<(ReconstructionRecord, bool)> {
        let mut tx = self.begin().await?;
        let clinical = is_clinical(&mut tx, id).await?;
        if is_full(&mut tx, clinical, max_queued).await? {
            return Err(Error::Busy("the queue of reconstructions is full (jobs.max_queued)"));
        }
        let named: Option<String> = sqlx::query_scalar(
            "SELECT result FROM reconstructions WHERE id = $1 AND state IN ('succeeded', 'superseded')",
        )
        .bind(id.to_string())
        .fetch_optional(&mut *tx)
        .await?
        .flatten();
        let ours = named.as_deref() == Some(prefix);
        if ours {
            queue_again(&mut tx, id, now_ms()).await?;
        }
        let record = reconstructions::one(&mut tx, id).await?;
        tx.commit().await?;
        let record = record.ok_or_else(|| Error::NotFound { what: "reconstruction", id: id.to_string() })?;
        Ok((record, ours))
    }

    /// See `Store::claim`.
    pub(crate) async fn claim(&self, worker: &str, lease: Duration) -> Result<Option<Claim>> {
        let now = now_ms();
        let mut tx = self.begin().await?;
        let row = sqlx::query(
            concat!("UPDATE reconstructions SET state = 'running', attempts = attempts + 1, fence = fence + 1, worker = $1, \
             lease_until_ms = $2, started_ms = $3, stage = NULL, fraction = 0.0, cancel_requested = FALSE \
             WHERE id = (SELECT id FROM reconstructions WHERE state = 'queued' \
                         AND (not_before_ms <= $3 OR not_before_ms > $3 + wait_ms) \
                         AND NOT EXISTS (SELECT 1 FROM series s WHERE s.series_uid = reconstructions.series_uid \
                                         AND s.identity_changing IS NOT NULL) \
                         ORDER BY CASE WHEN ", clinical!(), " THEN 0 ELSE 1 END, not_before_ms, id LIMIT 1) \
             RETURNING *"),
        )
        .bind(worker)
        .bind(now + milliseconds(lease))
        .bind(now)
        .fetch_optional(&mut *tx)
        .await?;
        let Some(row) = row else { return Ok(None) };
        let reconstruction = match rows::reconstruction(&row) {
            Ok(reconstruction) => reconstruction,
            Err(unreadable) => {
                // It would come up again and again, and keep all others waiting.
                fail_unreadable(&mut tx, row.try_get("id")?, &unreadable, now).await?;
                tx.commit().await?;
                return Err(unreadable);
            }
        };
        tx.commit().await?;
        let lease = Lease { id: reconstruction.id, fence: row.try_get("fence")? };
        Ok(Some(Claim { lease, reconstruction }))
    }

    /// See `Store::cancel`.
    pub(crate) async fn cancel(&self, id: ReconstructionId) -> Result<ReconstructionRecord> {
        let mut tx = self.begin().await?;
        sqlx::query(
            "UPDATE reconstructions SET cancel_requested = TRUE, \
             finished_ms = CASE WHEN state = 'queued' THEN $2 ELSE finished_ms END, \
             state = CASE WHEN state = 'queued' THEN 'cancelled' ELSE state END \
             WHERE id = $1 AND state IN ('queued', 'running')",
        )
        .bind(id.to_string())
        .bind(now_ms())
        .execute(&mut *tx)
        .await?;
        let record = reconstructions::one(&mut tx, id).await?;
        tx.commit().await?;
        record.ok_or_else(|| Error::NotFound { what: "reconstruction", id: id.to_string() })
    }

    /// When the next queued one may be claimed; those of a series whose identity is changing may not.
    pub(crate) async fn next_claim_ms(&self) -> Result<Option<i64>> {
        Ok(sqlx::query_scalar(
            "SELECT MIN(not_before_ms) FROM reconstructions WHERE state = 'queued' \
             AND NOT EXISTS (SELECT 1 FROM series s WHERE s.series_uid = reconstructions.series_uid \
                             AND s.identity_changing IS NOT NULL)",
        )
        .fetch_one(&self.readers)
        .await?)
    }

    /// How many are queued.
    pub(crate) async fn queued(&self) -> Result<u64> {
        let queued = count_queued(&mut *self.readers.acquire().await?).await?;
        Ok(u64::try_from(queued).unwrap_or_default())
    }
}

/// Queues what is wanted within the caller's transaction, unless it is there already.
pub(super) async fn enqueue(
    connection: &mut Connection,
    wanted: &Wanted<'_>,
    max_queued: u64,
    now: i64,
) -> Result<Enqueued> {
    let existing = reconstructions::id_of(connection, wanted.series, wanted.set, wanted.parameters).await?;
    let existing = match existing {
        Some(id) => reconstructions::one(connection, id).await?,
        None => None,
    };
    let again = match existing {
        None => None,
        Some(record)
            if matches!(record.state, ReconstructionState::Failed | ReconstructionState::Cancelled) =>
        {
            Some(record.id)
        }
        Some(record) => return Ok(Enqueued::Existing(record.id)),
    };
    let clinical = match again {
        Some(id) => wanted.own || is_clinical(connection, id).await?,
        None => wanted.own,
    };
    if is_full(connection, clinical, max_queued).await? {
        return Ok(Enqueued::Full);
    }
    if let Some(id) = again {
        queue_again(connection, id, now).await?;
        return Ok(Enqueued::Queued(id));
    }
    let id = ReconstructionId::new();
    sqlx::query(
        "INSERT INTO reconstructions (id, series_uid, revision, instances_sha256, instances, parameters, \
         parameters_sha256, settings_sha256, algorithm, software, state, fraction, attempts, error_instances, has_report, created_ms, \
         not_before_ms, fence, cancel_requested) \
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, 'queued', 0.0, 0, '[]', FALSE, $11, $11, 0, FALSE)",
    )
    .bind(id.to_string())
    .bind(wanted.series.as_str())
    .bind(i64::from(wanted.revision))
    .bind(wanted.set.as_slice())
    .bind(wanted.instances)
    .bind(parameter_json::write(wanted.parameters))
    .bind(identity_sha256(wanted.parameters).as_slice())
    .bind(settings_sha256(wanted.parameters).as_slice())
    .bind(wanted.parameters.profile.algorithm())
    .bind(crate::SOFTWARE)
    .bind(now)
    .execute(connection)
    .await?;
    Ok(Enqueued::Queued(id))
}

/// Makes a reconstruction that has ended wait for a worker again, as if it were new.
pub(super) async fn queue_again(connection: &mut Connection, id: ReconstructionId, now: i64) -> Result<()> {
    sqlx::query(
        "INSERT INTO removed_blobs (blob) SELECT result FROM reconstructions \
         WHERE id = $1 AND result IS NOT NULL ON CONFLICT (blob) DO NOTHING",
    )
    .bind(id.to_string())
    .execute(&mut *connection)
    .await?;
    sqlx::query(
        "UPDATE reconstructions SET state = 'queued', stage = NULL, fraction = 0.0, attempts = 0, \
         error_code = NULL, error_detail = NULL, error_instances = '[]', result = NULL, result_files = NULL, has_report = FALSE, \
         has_pictures = FALSE, superseded_by = NULL, software = $3, started_ms = NULL, finished_ms = NULL, \
         not_before_ms = $2, wait_ms = 0, deferred_since_ms = NULL, cancel_requested = FALSE \
         WHERE id = $1",
    )
    .bind(id.to_string())
    .bind(now)
    .bind(crate::SOFTWARE)
    .execute(connection)
    .await?;
    Ok(())
}

/// Ends a job whose row this software can't understand.
async fn fail_unreadable(connection: &mut Connection, id: &str, why: &Error, now: i64) -> Result<()> {
    sqlx::query(
        "UPDATE reconstructions SET state = 'failed', stage = NULL, fraction = 0.0, error_code = $2, \
         error_detail = $3, finished_ms = $4, worker = NULL, lease_until_ms = NULL WHERE id = $1",
    )
    .bind(id)
    .bind(why.mapping().code.replace('-', "_"))
    .bind(why.to_string())
    .bind(now)
    .execute(connection)
    .await?;
    Ok(())
}

/// Whether it is, or was, one that a series' own cloud comes from: by the service, or chosen.
async fn is_clinical(connection: &mut Connection, id: ReconstructionId) -> Result<bool> {
    let sql = concat!("SELECT COUNT(*) FROM reconstructions WHERE id = $1 AND ", clinical!());
    Ok(sqlx::query_scalar::<_, i64>(sql).bind(id.to_string()).fetch_one(connection).await? > 0)
}

/// Whether there is no room for one more. What somebody tries takes none from clinical ones, of which there
/// may be `max_queued` whatever else waits.
async fn is_full(connection: &mut Connection, clinical: bool, max_queued: u64) -> Result<bool> {
    let queued = if clinical {
        let sql = concat!("SELECT COUNT(*) FROM reconstructions WHERE state = 'queued' AND ", clinical!());
        sqlx::query_scalar(sql).fetch_one(connection).await?
    } else {
        count_queued(connection).await?
    };
    Ok(queued >= super::instances::signed(max_queued))
}

async fn count_queued(connection: &mut Connection) -> Result<i64> {
    Ok(sqlx::query_scalar("SELECT COUNT(*) FROM reconstructions WHERE state = 'queued'")
        .fetch_one(connection)
        .await?)
}

/// For a column of times.
pub(super) fn milliseconds(duration: Duration) -> i64 {
    i64::try_from(duration.as_millis()).unwrap_or(i64::MAX / 2)
}
