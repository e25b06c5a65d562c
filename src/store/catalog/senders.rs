//! Who still sends a series, how many instances are expected, and when a series is due: the rows
//! by which completeness survives a restart.

use uuid::Uuid;

use super::completion::{Completion, Policy, QUEUE_FULL_RETRY_MS, complete};
use super::corrections::{self, Settled};
use super::dialect::Connection;
use super::instances::{self, signed};
use super::transfers::{self, Ended, OpenSender};
use super::{Catalog, now_ms, rows, series};
use crate::dicom::header::InstanceHeader;
use crate::dicom::uid::{SeriesInstanceUid, SopInstanceUid};
use crate::error::Result;
use crate::store::records::{CompleteReason, SenderEnd, SeriesState};

/// The code under which an instance stands that was cut on its way.
const CUT: &str = "cut-instance";

impl Catalog {
    /// A duplicate came: the sender is alive, so a series that is still receiving waits on. One
    /// that is complete stays so. Where the identity is changing, the instance is confirmed.
    pub(crate) async fn heard_again(
        &self,
        header: &InstanceHeader,
        sender: &OpenSender,
        policy: &Policy,
    ) -> Result<Settled> {
        let uid = &header.series_instance_uid;
        let mut tx = self.begin().await?;
        let settled = corrections::confirm(&mut tx, uid, &header.sop_instance_uid, now_ms()).await?;
        heard(&mut tx, uid, sender, &self.process, policy).await?;
        transfers::brought(&mut tx, uid, &header.sop_instance_uid, sender.id, false).await?;
        tx.commit().await?;
        Ok(settled)
    }

    /// The sender ended. If it ended well, its series that nobody else sends are due after the short
    /// quiet time, for the reason that says what kind of sender it was; if not, after the long one, and
    /// they are in doubt. Gives its series.
    pub(crate) async fn sender_ended(
        &self,
        sender: Uuid,
        ended: &Ended,
        policy: &Policy,
    ) -> Result<Vec<SeriesInstanceUid>> {
        let mut tx = self.begin().await?;
        let gone = forget(&mut tx, sender).await?;
        for (uid, sender) in &gone {
            note_end(&mut tx, uid, sender, &self.process, ended, policy).await?;
        }
        let mut series: Vec<SeriesInstanceUid> = gone.into_iter().map(|(uid, _)| uid).collect();
        for (instance, uid) in &ended.of_series {
            if !series.contains(uid) && instances::find(&mut tx, instance).await?.is_none() {
                note_cut(&mut tx, uid, instance, (sender, &self.process), ended, policy).await?;
                series.push(uid.clone());
            }
        }
        tx.commit().await?;
        Ok(series)
    }

    /// The senders of former processes ended with them: none of them well. Gives their series.
    pub(crate) async fn former_senders_ended(&self, policy: &Policy) -> Result<Vec<SeriesInstanceUid>> {
        let mut tx = self.begin().await?;
        let gone = sqlx::query("DELETE FROM open_senders WHERE process <> $1 RETURNING *")
            .bind(&self.process)
            .fetch_all(&mut *tx)
            .await?;
        let mut orphaned = Vec::new();
        for row in &gone {
            let (uid, sender) = rows::open_sender(row)?;
            note_end(&mut tx, &uid, &sender, "", &Ended::with_its_process(), policy).await?;
            orphaned.push(uid);
        }
        orphaned.sort_unstable();
        orphaned.dedup();
        // Instances that were entered at the start: nobody sends them, and nobody said that they
        // are all.
        sqlx::query(
            "UPDATE series SET due_ms = $1, due_reason = $2 WHERE state = 'receiving' AND due_ms IS NULL",
        )
        .bind(now_ms() + policy.quiet_ms)
        .bind(CompleteReason::Quiet.name())
        .execute(&mut *tx)
        .await?;
        tx.commit().await?;
        Ok(orphaned)
    }

    /// The upload is whole: completes its series, but for those that wait for an expected number
    /// or that somebody else still sends. Gives all of them, and what became of the completed ones.
    pub(crate) async fn upload_ended(
        &self,
        sender: Uuid,
        policy: &Policy,
    ) -> Result<Vec<(SeriesInstanceUid, Option<Completion>)>> {
        let now = now_ms();
        let mut tx = self.begin().await?;
        let mut ended = Vec::new();
        for (uid, sender) in forget(&mut tx, sender).await? {
            let instances = series::one(&mut tx, &uid).await?.map_or(0, |series| series.instances);
            record_end(&mut tx, &uid, SenderEnd::UploadEnded).await?;
            transfers::mended(&mut tx, &uid, &sender, &self.process).await?;
            let waits = expected(&mut tx, &uid).await?.is_some_and(|expected| instances < expected)
                || transfers::is_held(&mut tx, &uid).await?
                || is_being_sent(&mut tx, &uid, policy).await?;
            let completion = if waits {
                None
            } else {
                Some(complete(&mut tx, &uid, CompleteReason::UploadEnded, policy, now).await?)
            };
            ended.push((uid, completion));
        }
        tx.commit().await?;
        Ok(ended)
    }

    /// Sets the expected number; completes the series if that many are there.
    pub(crate) async fn expect(
        &self,
        uid: &SeriesInstanceUid,
        instances: u64,
        policy: &Policy,
    ) -> Result<Option<Completion>> {
        let now = now_ms();
        let mut tx = self.begin().await?;
        sqlx::query(
            "INSERT INTO expectations (series_uid, expected_instances, set_ms) VALUES ($1, $2, $3) \
             ON CONFLICT (series_uid) DO UPDATE SET expected_instances = excluded.expected_instances, \
             set_ms = excluded.set_ms",
        )
        .bind(uid.as_str())
        .bind(signed(instances))
        .bind(now)
        .execute(&mut *tx)
        .await?;
        let series = series::one(&mut tx, uid).await?;
        let enough = series.as_ref().is_some_and(|series| series.instances >= instances);
        if let Some(series) = series.as_ref().filter(|series| series.state != SeriesState::Receiving) {
            // A word that it is complete stands; retention may have taken what was there.
            let short = series.complete_reason != Some(CompleteReason::Explicit) && series.instances > 0;
            if enough {
                transfers::lift(&mut tx, uid).await?;
            } else if short {
                transfers::set_short(&mut tx, uid, true).await?;
            }
            transfers::refresh(&mut tx, uid).await?;
        }
        let whole = enough && series.is_some_and(|series| series.state == SeriesState::Receiving);
        let completion = if whole {
            Some(complete(&mut tx, uid, CompleteReason::ExpectedInstances, policy, now).await?)
        } else {
            None
        };
        tx.commit().await?;
        Ok(completion)
    }

    /// Completes a series for a reason from outside; `None` if there is no such series.
    pub(crate) async fn complete(
        &self,
        uid: &SeriesInstanceUid,
        reason: CompleteReason,
        policy: &Policy,
    ) -> Result<Option<Completion>> {
        let mut tx = self.begin().await?;
        if series::one(&mut tx, uid).await?.is_none() {
            return Ok(None);
        }
        let completion = complete(&mut tx, uid, reason, policy, now_ms()).await?;
        tx.commit().await?;
        Ok(Some(completion))
    }

    /// Series whose deadline has passed.
    pub(crate) async fn due(&self) -> Result<Vec<SeriesInstanceUid>> {
        let due = sqlx::query_scalar(
            "SELECT series_uid FROM series WHERE due_ms <= $1 ORDER BY due_ms, series_uid",
        )
        .bind(now_ms())
        .fetch_all(&self.readers)
        .await?;
        Ok(uids(due))
    }

    /// The next deadline.
    pub(crate) async fn next_due_ms(&self) -> Result<Option<i64>> {
        Ok(sqlx::query_scalar("SELECT MIN(due_ms) FROM series WHERE due_ms IS NOT NULL")
            .fetch_one(&self.readers)
            .await?)
    }

    /// Brings back what a clock that was set back has moved away: a deadline is never farther off
    /// than its full length, and no sender was heard in the future.
    pub(crate) async fn follow_clock(&self, policy: &Policy) -> Result<()> {
        let now = now_ms();
        let short = policy.quiet_after_association_ms.max(QUEUE_FULL_RETRY_MS);
        let strayed: i64 = sqlx::query_scalar(
            "SELECT (SELECT COUNT(*) FROM series WHERE due_ms > $1 + CASE due_reason WHEN 'quiet' THEN $2 ELSE $3 END) \
             + (SELECT COUNT(*) FROM open_senders WHERE heard_ms > $1)",
        )
        .bind(now)
        .bind(policy.quiet_ms)
        .bind(short)
        .fetch_one(&self.readers)
        .await?;
        if strayed == 0 {
            return Ok(());
        }
        let mut tx = self.begin().await?;
        let moved = sqlx::query(
            "UPDATE series SET due_ms = $1 + CASE due_reason WHEN 'quiet' THEN $2 ELSE $3 END \
             WHERE due_ms > $1 + CASE due_reason WHEN 'quiet' THEN $2 ELSE $3 END",
        )
        .bind(now)
        .bind(policy.quiet_ms)
        .bind(short)
        .execute(&mut *tx)
        .await?;
        sqlx::query("UPDATE open_senders SET heard_ms = $1 WHERE heard_ms > $1")
            .bind(now)
            .execute(&mut *tx)
            .await?;
        tx.commit().await?;
        if moved.rows_affected() > 0 {
            tracing::warn!(series = moved.rows_affected(), "the clock was set back; deadlines follow it");
        }
        Ok(())
    }

    /// Completes a series if it is still due, for the reason that its deadline was set for.
    pub(crate) async fn fire(&self, uid: &SeriesInstanceUid, policy: &Policy) -> Result<Option<Completion>> {
        let now = now_ms();
        let mut tx = self.begin().await?;
        let row = sqlx::query("SELECT due_reason FROM series WHERE series_uid = $1 AND due_ms <= $2")
            .bind(uid.as_str())
            .bind(now)
            .fetch_optional(&mut *tx)
            .await?;
        let Some(reason) = row.map(|row| rows::due_reason(&row)).transpose()?.flatten() else {
            return Ok(None);
        };
        let completion = complete(&mut tx, uid, reason, policy, now).await?;
        tx.commit().await?;
        Ok(Some(completion))
    }
}

/// Something of the series came from `sender`: it is due after the quiet time, counted anew.
pub(super) async fn heard(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    sender: &OpenSender,
    process: &str,
    policy: &Policy,
) -> Result<()> {
    let now = now_ms();
    sqlx::query(
        "INSERT INTO open_senders (sender, series_uid, process, heard_ms, begun, is_upload) \
         VALUES ($1, $2, $3, $4, $5, $6) \
         ON CONFLICT (sender, series_uid) DO UPDATE SET heard_ms = excluded.heard_ms",
    )
    .bind(sender.id.to_string())
    .bind(uid.as_str())
    .bind(process)
    .bind(now)
    .bind(sender.begun)
    .bind(sender.is_upload)
    .execute(&mut *connection)
    .await?;
    set_due(connection, uid, now + policy.quiet_ms, CompleteReason::Quiet).await
}

/// Sets the deadline of a series that is receiving.
pub(super) async fn set_due(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    due_ms: i64,
    reason: CompleteReason,
) -> Result<()> {
    sqlx::query(
        "UPDATE series SET due_ms = $2, due_reason = $3 WHERE series_uid = $1 AND state = 'receiving'",
    )
    .bind(uid.as_str())
    .bind(due_ms)
    .bind(reason.name())
    .execute(connection)
    .await?;
    Ok(())
}

/// The expected number of instances.
pub(super) async fn expected(connection: &mut Connection, uid: &SeriesInstanceUid) -> Result<Option<u64>> {
    let row = sqlx::query("SELECT expected_instances FROM expectations WHERE series_uid = $1")
        .bind(uid.as_str())
        .fetch_optional(connection)
        .await?;
    Ok(row.map(|row| rows::number(&row, "expected_instances")).transpose()?)
}

/// Whether an open sender sent something of the series within the quiet time: one that is open but
/// silent for longer keeps nothing waiting.
async fn is_being_sent(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    policy: &Policy,
) -> Result<bool> {
    let heard = "SELECT COUNT(*) FROM open_senders WHERE series_uid = $1 AND heard_ms > $2";
    let senders: i64 = sqlx::query_scalar(heard)
        .bind(uid.as_str())
        .bind(now_ms() - policy.quiet_ms)
        .fetch_one(connection)
        .await?;
    Ok(senders > 0)
}

/// Removes the sender; gives the series that it sent.
async fn forget(connection: &mut Connection, sender: Uuid) -> Result<Vec<(SeriesInstanceUid, OpenSender)>> {
    let gone = sqlx::query("DELETE FROM open_senders WHERE sender = $1 RETURNING *")
        .bind(sender.to_string())
        .fetch_all(connection)
        .await?;
    let mut gone = gone.iter().map(rows::open_sender).collect::<Result<Vec<_>, sqlx::Error>>()?;
    gone.sort_unstable_by(|one, other| one.0.cmp(&other.0));
    Ok(gone)
}

/// What the end of one of its senders means to a series.
async fn note_end(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    sender: &OpenSender,
    process: &str,
    ended: &Ended,
    policy: &Policy,
) -> Result<()> {
    record_end(connection, uid, ended.end).await?;
    if let Some(reason) = ended.end.completes() {
        transfers::mended(connection, uid, sender, process).await?;
        return hasten(connection, uid, reason, policy).await;
    }
    // Who said that it is complete, or how many there are, knew better.
    let known = [Some(CompleteReason::Explicit), Some(CompleteReason::ExpectedInstances)];
    let record = series::one(connection, uid).await?;
    let is_whole = record.is_some_and(|record| {
        record.state != SeriesState::Receiving && known.contains(&record.complete_reason)
    });
    if !is_whole {
        transfers::broke(connection, uid, sender, process, ended).await?;
    }
    // Counted anew: the sender may try again.
    set_due(connection, uid, now_ms() + policy.quiet_ms, CompleteReason::Quiet).await
}

/// A sender that had brought nothing else of a series broke off within an instance of it. What lacks of a
/// series that is not there yet is held against it when it comes.
async fn note_cut(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    instance: &SopInstanceUid,
    (sender, process): (Uuid, &str),
    ended: &Ended,
    policy: &Policy,
) -> Result<()> {
    if series::one(connection, uid).await?.is_none() {
        return instances::refuse(connection, uid, instance, CUT, None).await;
    }
    // The one instance is all that is known of it: that makes it good.
    let sender = OpenSender { id: sender, begun: ended.at, is_upload: false };
    let ended = Ended { cut: vec![instance.clone()], of_series: Vec::new(), ..ended.clone() };
    note_end(connection, uid, &sender, process, &ended, policy).await
}

async fn record_end(connection: &mut Connection, uid: &SeriesInstanceUid, end: SenderEnd) -> Result<()> {
    sqlx::query("UPDATE series SET sender_end = $2 WHERE series_uid = $1")
        .bind(uid.as_str())
        .bind(end.name())
        .execute(connection)
        .await?;
    Ok(())
}

/// A sender of the series ended: if it was the last one, the deadline comes nearer.
async fn hasten(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    reason: CompleteReason,
    policy: &Policy,
) -> Result<()> {
    if transfers::is_held(connection, uid).await? || is_being_sent(connection, uid, policy).await? {
        return Ok(());
    }
    sqlx::query(
        "UPDATE series SET due_ms = $2, due_reason = $3 \
         WHERE series_uid = $1 AND state = 'receiving' AND (due_ms IS NULL OR due_ms > $2)",
    )
    .bind(uid.as_str())
    .bind(now_ms() + policy.quiet_after_association_ms)
    .bind(reason.name())
    .execute(connection)
    .await?;
    Ok(())
}

/// UIDs as the catalog holds them, sorted, each once.
fn uids(texts: Vec<String>) -> Vec<SeriesInstanceUid> {
    let mut uids: Vec<SeriesInstanceUid> = texts.into_iter().filter_map(|text| text.parse().ok()).collect();
    uids.sort_unstable();
    uids.dedup();
    uids
}
