//! The one transaction that makes a series complete: its revision, its fitness and its job change
//! together or not at all.

use super::dialect::Connection;
use super::instances::{set_sha256, signed};
use super::queue::{self, Enqueued};
use super::{Catalog, clinical, corrections, reconstructions, rows, senders, series, transfers};
use crate::dicom::header::InstanceHeader;
use crate::dicom::identity::{IdentityField, parted};
use crate::dicom::series::UnfitReason;
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::Result;
use crate::pipeline::Parameters;
use crate::store::records::{CompleteReason, InstanceRecord, ReconstructionId, SeriesState};

/// A completion that found the queue full is tried again after this time.
pub(super) const QUEUE_FULL_RETRY_MS: i64 = 1_000;

/// The settings by which series are collected and completed.
#[derive(Debug)]
pub(crate) struct Policy {
    /// Instances of one series.
    pub(crate) max_series_instances: u64,
    /// Quiet time that completes a series.
    pub(crate) quiet_ms: i64,
    /// Quiet time after its last sender ended.
    pub(crate) quiet_after_association_ms: i64,
    /// Of the reconstruction that a completed series becomes.
    pub(crate) parameters: Parameters,
    /// Queued reconstructions.
    pub(crate) max_queued: u64,
    /// Fewer slices are no head.
    pub(crate) min_slices: usize,
    /// Tells from the headers and `min_slices` why a series is no head CT.
    pub(crate) unfit: fn(&[InstanceHeader], usize) -> Option<UnfitReason>,
}

/// What became of a series that was to be completed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Completion {
    /// The reason for which.
    pub(crate) reason: CompleteReason,
    /// What became of it.
    pub(crate) end: End,
}

/// See [`Completion`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum End {
    /// It was complete before; its reconstruction with the policy's parameters, if there is one.
    Already(Option<ReconstructionId>),
    /// It is kept, but no head CT.
    Unfit(UnfitReason),
    /// It has a reconstruction: newly queued, or made before from the same instances.
    Reconstruction {
        /// Which.
        id: ReconstructionId,
        /// Newly queued.
        queued: bool,
    },
    /// No room for its job: it stays receiving, and due in a moment for the same reason.
    QueueFull,
}

/// Completes a receiving series within the caller's transaction.
pub(super) async fn complete(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    reason: CompleteReason,
    policy: &Policy,
    now: i64,
) -> Result<Completion> {
    let end = end(connection, uid, reason, policy, now).await?;
    Ok(Completion { reason, end })
}

async fn end(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    reason: CompleteReason,
    policy: &Policy,
    now: i64,
) -> Result<End> {
    let Some(record) = series::one(connection, uid).await? else { return Ok(End::Already(None)) };
    let former_set = series::complete_set(connection, uid).await?;
    if record.state != SeriesState::Receiving {
        let id = match former_set {
            Some(set) => reconstructions::id_of(connection, uid, &set, &policy.parameters).await?,
            None => None,
        };
        if reason == CompleteReason::Explicit {
            transfers::lift(connection, uid).await?;
            transfers::lift_refusals(connection, uid).await?;
            transfers::refresh(connection, uid).await?;
        }
        return Ok(End::Already(id));
    }

    let instances = all(connection, uid).await?;
    let set = set_sha256(&instances);
    // The same set again (removed by retention, sent again) is the same revision.
    let revision = if former_set == Some(set) { record.revision } else { record.revision + 1 };
    let headers: Vec<InstanceHeader> = instances.into_iter().map(|instance| instance.header).collect();
    let unfit = (policy.unfit)(&headers, policy.min_slices);
    let end = match unfit {
        Some(unfit) => End::Unfit(unfit),
        None => {
            let wanted = queue::Wanted {
                series: uid,
                revision,
                set: &set,
                instances: signed(headers.len() as u64),
                parameters: &policy.parameters,
                own: true,
            };
            match queue::enqueue(connection, &wanted, policy.max_queued, now).await? {
                Enqueued::Queued(id) => End::Reconstruction { id, queued: true },
                Enqueued::Existing(id) => End::Reconstruction { id, queued: false },
                Enqueued::Full => {
                    senders::set_due(connection, uid, now + QUEUE_FULL_RETRY_MS, reason).await?;
                    return Ok(End::QueueFull);
                }
            }
        }
    };
    if let End::Reconstruction { id, .. } = end {
        clinical::queued_by_the_service(connection, uid, id, revision).await?;
    }
    let short = record.expected_instances.is_some_and(|expected| record.instances < expected);
    match reason {
        CompleteReason::Explicit => {
            transfers::lift(connection, uid).await?;
            transfers::lift_refusals(connection, uid).await?;
        }
        CompleteReason::ExpectedInstances => transfers::lift(connection, uid).await?,
        _ => transfers::set_short(connection, uid, short).await?,
    }
    let state = if unfit.is_some() { SeriesState::NotReconstructable } else { SeriesState::Complete };
    sqlx::query(
        "UPDATE series SET state = $2, unfit_reason = $3, revision = $4, complete_reason = $5, instances_sha256 = $6, \
         due_ms = NULL, due_reason = NULL WHERE series_uid = $1",
    )
    .bind(uid.as_str())
    .bind(state.name())
    .bind(unfit.map(UnfitReason::name))
    .bind(i64::from(revision))
    .bind(reason.name())
    .bind(set.as_slice())
    .execute(&mut *connection)
    .await?;
    transfers::refresh(connection, uid).await?;
    if !record.identity_changing {
        // One patient's identity over all instances, or none.
        let identities: Vec<_> = headers.iter().map(|header| &header.identity).collect();
        let is_one = parted(&identities).is_none();
        let common = |field| {
            corrections::common(identities.iter().map(|identity| identity.get(field))).filter(|_| is_one)
        };
        sqlx::query("UPDATE series SET patient_id = $2, accession_number = $3 WHERE series_uid = $1")
            .bind(uid.as_str())
            .bind(common(IdentityField::PatientId))
            .bind(common(IdentityField::AccessionNumber))
            .execute(&mut *connection)
            .await?;
    }
    sqlx::query("UPDATE instances SET revision = $2 WHERE series_uid = $1 AND revision IS NULL")
        .bind(uid.as_str())
        .bind(i64::from(revision))
        .execute(connection)
        .await?;
    Ok(end)
}

impl Catalog {
    /// What the headers of a series say, in the order of their UIDs.
    pub(crate) async fn headers(&self, uid: &SeriesInstanceUid) -> Result<Vec<InstanceHeader>> {
        let instances = all(&mut *self.readers.acquire().await?, uid).await?;
        Ok(instances.into_iter().map(|instance| instance.header).collect())
    }
}

async fn all(connection: &mut Connection, uid: &SeriesInstanceUid) -> Result<Vec<InstanceRecord>> {
    let found = sqlx::query("SELECT * FROM instances WHERE series_uid = $1 ORDER BY sop_uid")
        .bind(uid.as_str())
        .fetch_all(connection)
        .await?;
    Ok(found.iter().map(rows::instance).collect::<Result<_, _>>()?)
}
