//! Doubts of transfer: senders that broke off and what makes their break good, instances that were
//! refused, and which revision was made under which doubt.

use uuid::Uuid;

use super::dialect::Connection;
use super::{Catalog, rows, senders, series};
use crate::dicom::uid::{SeriesInstanceUid, SopInstanceUid};
use crate::error::Result;
use crate::store::records::{BrokenTransfer, SenderEnd, TransferDoubt};

/// A sender of the process at hand.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OpenSender {
    /// Its id.
    pub(crate) id: Uuid,
    /// When it began, in the order of the process' begins and breaks.
    pub(crate) begun: i64,
    /// An HTTP request, not an association.
    pub(crate) is_upload: bool,
}

/// How a sender ended.
#[derive(Debug, Clone)]
pub(crate) struct Ended {
    /// How.
    pub(crate) end: SenderEnd,
    /// When, in the order of the process' begins and breaks.
    pub(crate) at: i64,
    /// Instances that were under way, or were refused and did not come again.
    pub(crate) cut: Vec<SopInstanceUid>,
    /// Those of them whose series is known.
    pub(crate) of_series: Vec<(SopInstanceUid, SeriesInstanceUid)>,
    /// Files of it that can't be told to be an instance were damaged.
    pub(crate) has_unnamed: bool,
}

impl Ended {
    /// The same of a former process, of which no more is known.
    pub(super) fn with_its_process() -> Self {
        let (cut, of_series) = (Vec::new(), Vec::new());
        Self { end: SenderEnd::ServiceStopped, at: 0, cut, of_series, has_unnamed: false }
    }
}

impl Catalog {
    /// The breaks that are held against a series.
    pub(crate) async fn broken_transfers(&self, uid: &SeriesInstanceUid) -> Result<Vec<BrokenTransfer>> {
        let found = sqlx::query(
            "SELECT b.sender_end, (SELECT COUNT(*) FROM cut_instances c WHERE c.sender = b.sender \
             AND c.series_uid = b.series_uid AND NOT EXISTS (SELECT 1 FROM instances i WHERE i.sop_uid = c.sop_uid)) \
             AS missing FROM broken_transfers b WHERE b.series_uid = $1 ORDER BY b.broken, b.sender",
        )
        .bind(uid.as_str())
        .fetch_all(&self.readers)
        .await?;
        Ok(found.iter().map(rows::broken_transfer).collect::<Result<_, sqlx::Error>>()?)
    }
}

/// The sender brought that instance, new or again: a refusal of it is no doubt any more.
pub(super) async fn brought(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    instance: &SopInstanceUid,
    sender: Uuid,
    is_new: bool,
) -> Result<()> {
    sqlx::query(
        "INSERT INTO sent_instances (sender, series_uid, sop_uid, is_new) VALUES ($1, $2, $3, $4) \
         ON CONFLICT (sender, sop_uid) DO NOTHING",
    )
    .bind(sender.to_string())
    .bind(uid.as_str())
    .bind(instance.as_str())
    .bind(is_new)
    .execute(&mut *connection)
    .await?;
    let lifted =
        sqlx::query("UPDATE refused SET held = FALSE WHERE series_uid = $1 AND sop_uid = $2 AND held")
            .bind(uid.as_str())
            .bind(instance.as_str())
            .execute(&mut *connection)
            .await?;
    if lifted.rows_affected() > 0 { refresh(connection, uid).await } else { Ok(()) }
}

/// The sender's break is held against the series.
pub(super) async fn broke(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    sender: &OpenSender,
    process: &str,
    ended: &Ended,
) -> Result<()> {
    // What lacks is known by name, so that it may come by itself.
    let is_named = ended.end == SenderEnd::InstancesRefused && !ended.has_unnamed;
    sqlx::query(
        "INSERT INTO broken_transfers (sender, series_uid, sender_end, process, broken, must_repeat) \
         VALUES ($1, $2, $3, $4, $5, $6) ON CONFLICT (series_uid, sender) DO NOTHING",
    )
    .bind(sender.id.to_string())
    .bind(uid.as_str())
    .bind(ended.end.name())
    .bind(process)
    .bind(ended.at)
    .bind(sender.is_upload && !is_named)
    .execute(&mut *connection)
    .await?;
    for instance in &ended.cut {
        sqlx::query(
            "INSERT INTO cut_instances (sender, series_uid, sop_uid) VALUES ($1, $2, $3) \
             ON CONFLICT (series_uid, sender, sop_uid) DO NOTHING",
        )
        .bind(sender.id.to_string())
        .bind(uid.as_str())
        .bind(instance.as_str())
        .execute(&mut *connection)
        .await?;
    }
    refresh(connection, uid).await
}

/// The sender ended well: it makes good each break that was before its begin, if an announced number is
/// reached, if what was cut then is stored by now, and if it can have brought all that lacked:
///
/// - it brought again all that is stored;
/// - or something new, and again all that the broken sender had brought;
/// - or something new, after an association that broke off within an instance: that one is stored, and what it meant
///   to send is gone on with.
///
/// What an association meant to send that broke off between two instances nobody knows: one more
/// instance is no end of it.
pub(super) async fn mended(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    sender: &OpenSender,
    process: &str,
) -> Result<()> {
    let id = sender.id.to_string();
    let instances = series::one(connection, uid).await?.map_or(0, |series| series.instances);
    if senders::expected(connection, uid).await?.is_none_or(|expected| expected <= instances) {
        let gone: Vec<String> = sqlx::query_scalar(
            "DELETE FROM broken_transfers WHERE series_uid = $1 AND (process <> $2 OR broken < $3) \
             AND NOT EXISTS (SELECT 1 FROM cut_instances c WHERE c.sender = broken_transfers.sender \
                 AND c.series_uid = $1 AND NOT EXISTS (SELECT 1 FROM instances i WHERE i.sop_uid = c.sop_uid)) \
             AND (NOT EXISTS (SELECT 1 FROM instances i WHERE i.series_uid = $1 AND NOT EXISTS ( \
                     SELECT 1 FROM sent_instances m WHERE m.sender = $4 AND m.sop_uid = i.sop_uid)) \
                 OR (EXISTS (SELECT 1 FROM sent_instances n WHERE n.sender = $4 AND n.series_uid = $1 AND n.is_new) \
                     AND ((NOT must_repeat AND EXISTS (SELECT 1 FROM cut_instances d \
                             WHERE d.sender = broken_transfers.sender AND d.series_uid = $1)) \
                         OR (EXISTS (SELECT 1 FROM sent_instances a \
                                 WHERE a.sender = broken_transfers.sender AND a.series_uid = $1) \
                             AND NOT EXISTS (SELECT 1 FROM sent_instances b \
                                 WHERE b.sender = broken_transfers.sender AND b.series_uid = $1 AND NOT EXISTS ( \
                                     SELECT 1 FROM sent_instances m WHERE m.sender = $4 \
                                     AND m.sop_uid = b.sop_uid)))))) \
             RETURNING sender",
        )
        .bind(uid.as_str())
        .bind(process)
        .bind(sender.begun)
        .bind(&id)
        .fetch_all(&mut *connection)
        .await?;
        for broken in gone {
            forget(connection, uid, &broken).await?;
        }
        refresh(connection, uid).await?;
    }
    forget(connection, uid, &id).await
}

/// What a sender brought, and what was cut of it, matters no more.
async fn forget(connection: &mut Connection, uid: &SeriesInstanceUid, sender: &str) -> Result<()> {
    for statement in [
        "DELETE FROM sent_instances WHERE series_uid = $1 AND sender = $2",
        "DELETE FROM cut_instances WHERE series_uid = $1 AND sender = $2",
    ] {
        sqlx::query(statement).bind(uid.as_str()).bind(sender).execute(&mut *connection).await?;
    }
    Ok(())
}

/// The series is whole, by word or by count: no break is held against it.
pub(super) async fn lift(connection: &mut Connection, uid: &SeriesInstanceUid) -> Result<()> {
    let gone: Vec<String> =
        sqlx::query_scalar("DELETE FROM broken_transfers WHERE series_uid = $1 RETURNING sender")
            .bind(uid.as_str())
            .fetch_all(&mut *connection)
            .await?;
    for sender in gone {
        forget(connection, uid, &sender).await?;
    }
    set_short(connection, uid, false).await
}

/// The series came back from files: nobody said that it is whole.
pub(super) async fn doubt(connection: &mut Connection, uid: &SeriesInstanceUid) -> Result<()> {
    sqlx::query(
        "INSERT INTO broken_transfers (sender, series_uid, sender_end, process, broken, must_repeat) \
         VALUES ('earlier', $1, $2, '', 0, FALSE) ON CONFLICT (series_uid, sender) DO NOTHING",
    )
    .bind(uid.as_str())
    .bind(SenderEnd::ServiceStopped.name())
    .execute(&mut *connection)
    .await?;
    refresh(connection, uid).await
}

/// The series' row came back from the record of a result: what that says of a doubt stands.
pub(super) async fn restored(connection: &mut Connection, uid: &SeriesInstanceUid) -> Result<()> {
    for statement in [
        "DELETE FROM broken_transfers WHERE series_uid = $1 AND sender = 'earlier' AND NOT EXISTS ( \
         SELECT 1 FROM series s WHERE s.series_uid = $1 AND s.incomplete_transfer)",
        "INSERT INTO broken_transfers (sender, series_uid, sender_end, process, broken, must_repeat) \
         SELECT 'earlier', series_uid, COALESCE(sender_end, 'service_stopped'), '', 0, FALSE FROM series \
         WHERE series_uid = $1 AND incomplete_transfer ON CONFLICT (series_uid, sender) DO NOTHING",
    ] {
        sqlx::query(statement).bind(uid.as_str()).execute(&mut *connection).await?;
    }
    Ok(())
}

/// By word the series is whole as it is: what was refused is no part of it.
pub(super) async fn lift_refusals(connection: &mut Connection, uid: &SeriesInstanceUid) -> Result<()> {
    sqlx::query("UPDATE refused SET held = FALSE WHERE series_uid = $1 AND held")
        .bind(uid.as_str())
        .execute(connection)
        .await?;
    Ok(())
}

/// Fewer instances are there than were announced.
pub(super) async fn set_short(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    is_short: bool,
) -> Result<()> {
    sqlx::query("UPDATE series SET short_of_expected = $2 WHERE series_uid = $1")
        .bind(uid.as_str())
        .bind(is_short)
        .execute(connection)
        .await?;
    Ok(())
}

/// Whether a break is held against the series.
pub(super) async fn is_held(connection: &mut Connection, uid: &SeriesInstanceUid) -> Result<bool> {
    let held: i64 = sqlx::query_scalar("SELECT COUNT(*) FROM broken_transfers WHERE series_uid = $1")
        .bind(uid.as_str())
        .fetch_one(connection)
        .await?;
    Ok(held > 0)
}

/// Brings the series' row up to what is held against it. Its latest revision shares its doubts until
/// the next one begins to come; from then on they stay as they are, whatever becomes of that.
pub(super) async fn refresh(connection: &mut Connection, uid: &SeriesInstanceUid) -> Result<()> {
    sqlx::query(
        "UPDATE series SET incomplete_transfer = short_of_expected OR EXISTS ( \
         SELECT 1 FROM broken_transfers b WHERE b.series_uid = series.series_uid) WHERE series_uid = $1",
    )
    .bind(uid.as_str())
    .execute(&mut *connection)
    .await?;
    let Some(record) = series::one(connection, uid).await? else { return Ok(()) };
    sqlx::query(
        "UPDATE reconstructions SET transfer_doubts = $2 WHERE series_uid = $1 AND EXISTS ( \
         SELECT 1 FROM series s WHERE s.series_uid = $1 AND s.state <> 'receiving' \
         AND s.instances_sha256 = reconstructions.instances_sha256)",
    )
    .bind(uid.as_str())
    .bind(joined(&record.doubts))
    .execute(connection)
    .await?;
    Ok(())
}

fn joined(doubts: &[TransferDoubt]) -> String {
    // That of the decoder is a reconstruction's own.
    let of_transfer = doubts.iter().filter(|doubt| **doubt != TransferDoubt::FormerDecoder);
    let names: Vec<&str> = of_transfer.map(|doubt| doubt.name()).collect();
    names.join(",")
}
