//! How a running reconstruction goes on and ends.
//!
//! A worker holds it by a lease with a fencing token. Every statement that a worker causes names
//! both, so one that lost its lease (too slow, or thought dead) changes nothing.

use std::time::Duration;

use sqlx::Row as _;

use super::queue::milliseconds;
use super::rows::ResultFiles;
use super::{Catalog, Transaction, now_ms, reconstructions, recovery, rows};
use crate::error::{Error, Result};
use crate::observer::Stage;
use crate::store::hashed::Seal;
use crate::store::queue::{Fault, Heartbeat, Lease, Reclaim};
use crate::store::records::{ReconstructionId, ReconstructionRecord};
use crate::store::recovery::ResultRecord;

/// No lease is longer, ms.
const LONGEST_LEASE_MS: i64 = 300_000;

/// A reconstruction that has ended, not committed yet.
#[derive(Debug)]
pub(crate) struct Ended {
    pub(crate) tx: Transaction,
    /// Goes beside its result.
    pub(crate) record: ResultRecord,
}

impl Catalog {
    /// See `Store::heartbeat`.
    pub(crate) async fn heartbeat(
        &self,
        lease: &Lease,
        stage: Stage,
        fraction: f64,
        renew_for: Duration,
    ) -> Result<Heartbeat> {
        let mut tx = self.begin().await?;
        let row = sqlx::query(
            "UPDATE reconstructions SET stage = $3, fraction = $4, lease_until_ms = $5 \
             WHERE id = $1 AND fence = $2 AND state = 'running' RETURNING cancel_requested",
        )
        .bind(lease.id.to_string())
        .bind(lease.fence)
        .bind(stage.name())
        .bind(fraction.clamp(0.0, 1.0))
        .bind(now_ms() + milliseconds(renew_for))
        .fetch_optional(&mut *tx)
        .await?;
        tx.commit().await?;
        Ok(match row.map(|row| row.try_get("cancel_requested")).transpose()? {
            None => Heartbeat::Lost,
            Some(true) => Heartbeat::CancelRequested,
            Some(false) => Heartbeat::Ours,
        })
    }

    /// Marks success with its durable result. `None`: the lease was lost. It counts when the record is
    /// durable and the transaction is committed.
    pub(crate) async fn succeed(
        &self,
        lease: &Lease,
        result: &ResultFiles,
        figures: &str,
        quality: Option<&str>,
        has_pictures: bool,
    ) -> Result<Option<Ended>> {
        let mut tx = self.begin().await?;
        let row = sqlx::query(
            "UPDATE reconstructions SET state = 'succeeded', stage = NULL, fraction = 1.0, figures = $3, result = $4, \
             has_report = TRUE, error_code = NULL, error_detail = NULL, error_instances = '[]', finished_ms = $5, \
             worker = NULL, lease_until_ms = NULL, quality = $6, has_pictures = $7, result_files = $8, \
             deferred_since_ms = NULL \
             WHERE id = $1 AND fence = $2 AND state = 'running' RETURNING *",
        )
        .bind(lease.id.to_string())
        .bind(lease.fence)
        .bind(figures)
        .bind(&result.prefix)
        .bind(now_ms())
        .bind(quality)
        .bind(has_pictures)
        .bind(result.seal.as_ref().map(Seal::to_json))
        .fetch_optional(&mut *tx)
        .await?;
        let Some(row) = row else { return Ok(None) };
        reconstructions::supersede(&mut tx, &row).await?;
        let record = recovery::record(&mut tx, lease.id).await?;
        Ok(Some(Ended { tx, record }))
    }

    /// Marks failure, with its durable report if there is one. `None`: the lease was lost. It counts when
    /// the record is durable and the transaction is committed.
    pub(crate) async fn fail(
        &self,
        lease: &Lease,
        fault: &Fault,
        result: Option<&ResultFiles>,
        has_pictures: bool,
    ) -> Result<Option<Ended>> {
        let instances = serde_json::to_string(&fault.instances).map_err(Error::internal)?;
        let mut tx = self.begin().await?;
        let done = sqlx::query(
            "UPDATE reconstructions SET state = 'failed', stage = NULL, fraction = 0.0, error_code = $3, error_detail = $4, error_instances = $5, \
             result = $6, has_report = ($6 IS NOT NULL), has_pictures = $8, finished_ms = $7, worker = NULL, \
             lease_until_ms = NULL, deferred_since_ms = NULL, result_files = $9 \
             WHERE id = $1 AND fence = $2 AND state = 'running'",
        )
        .bind(lease.id.to_string())
        .bind(lease.fence)
        .bind(&fault.code)
        .bind(&fault.detail)
        .bind(instances)
        .bind(result.map(|result| &result.prefix))
        .bind(now_ms())
        .bind(has_pictures)
        .bind(result.and_then(|result| result.seal.as_ref()).map(Seal::to_json))
        .execute(&mut *tx)
        .await?;
        if done.rows_affected() == 0 {
            return Ok(None);
        }
        let record = recovery::record(&mut tx, lease.id).await?;
        Ok(Some(Ended { tx, record }))
    }

    /// Marks a running one cancelled. False: the lease was lost.
    pub(crate) async fn finish_cancelled(&self, lease: &Lease) -> Result<bool> {
        let mut tx = self.begin().await?;
        let done = sqlx::query(
            "UPDATE reconstructions SET state = 'cancelled', stage = NULL, fraction = 0.0, finished_ms = $3, worker = NULL, lease_until_ms = NULL \
             WHERE id = $1 AND fence = $2 AND state = 'running'",
        )
        .bind(lease.id.to_string())
        .bind(lease.fence)
        .bind(now_ms())
        .execute(&mut *tx)
        .await?;
        tx.commit().await?;
        Ok(done.rows_affected() > 0)
    }

    /// Queues a running one again; see `Store::retry`. One that was to be cancelled is cancelled.
    pub(crate) async fn retry(&self, lease: &Lease, wait: Duration, fault: &Fault) -> Result<bool> {
        let now = now_ms();
        let mut tx = self.begin().await?;
        let done = sqlx::query(
            "UPDATE reconstructions SET state = CASE WHEN cancel_requested THEN 'cancelled' ELSE 'queued' END, \
             finished_ms = CASE WHEN cancel_requested THEN $6 ELSE NULL END, stage = NULL, fraction = 0.0, \
             not_before_ms = $6 + $3, wait_ms = $3, error_code = $4, error_detail = $5, worker = NULL, \
             lease_until_ms = NULL, deferred_since_ms = NULL \
             WHERE id = $1 AND fence = $2 AND state = 'running'",
        )
        .bind(lease.id.to_string())
        .bind(lease.fence)
        .bind(milliseconds(wait))
        .bind(&fault.code)
        .bind(&fault.detail)
        .bind(now)
        .execute(&mut *tx)
        .await?;
        tx.commit().await?;
        Ok(done.rows_affected() > 0)
    }

    /// Puts a running one back, its attempt not counted; see `Store::defer`.
    pub(crate) async fn defer(
        &self,
        lease: &Lease,
        (first, longest): (Duration, Duration),
        patience: Duration,
        fault: &Fault,
    ) -> Result<bool> {
        let now = now_ms();
        let mut tx = self.begin().await?;
        let since: Option<Option<i64>> = sqlx::query_scalar(
            "SELECT deferred_since_ms FROM reconstructions WHERE id = $1 AND fence = $2 AND state = 'running'",
        )
        .bind(lease.id.to_string())
        .bind(lease.fence)
        .fetch_optional(&mut *tx)
        .await?;
        let Some(since) = since else { return Ok(false) };
        // A clock that was set back begins the time anew.
        let since = since.filter(|since| *since <= now).unwrap_or(now);
        // Longer the longer it lasts: the work is done again each time.
        let wait = ((now - since) / 2).min(milliseconds(longest)).max(milliseconds(first));
        let given_up = now - since >= milliseconds(patience);
        let detail = if given_up {
            format!(
                "{}; put back for {} h without an attempt getting through",
                fault.detail,
                (now - since) / 3_600_000
            )
        } else {
            fault.detail.clone()
        };
        sqlx::query(
            "UPDATE reconstructions SET \
             state = CASE WHEN cancel_requested THEN 'cancelled' WHEN $3 THEN 'failed' ELSE 'queued' END, \
             finished_ms = CASE WHEN cancel_requested OR $3 THEN $4 ELSE NULL END, stage = NULL, fraction = 0.0, \
             attempts = attempts - 1, not_before_ms = $4 + $5, wait_ms = $5, deferred_since_ms = $6, \
             error_code = $7, error_detail = $8, worker = NULL, lease_until_ms = NULL WHERE id = $1 AND fence = $2",
        )
        .bind(lease.id.to_string())
        .bind(lease.fence)
        .bind(given_up)
        .bind(now)
        .bind(wait)
        .bind(since)
        .bind(&fault.code)
        .bind(detail)
        .execute(&mut *tx)
        .await?;
        tx.commit().await?;
        Ok(true)
    }

    /// Gives a running one back, its attempt not counted.
    pub(crate) async fn release(&self, lease: &Lease) -> Result<bool> {
        let mut tx = self.begin().await?;
        let done = sqlx::query(
            "UPDATE reconstructions SET state = CASE WHEN cancel_requested THEN 'cancelled' ELSE 'queued' END, \
             finished_ms = CASE WHEN cancel_requested THEN $3 ELSE NULL END, stage = NULL, fraction = 0.0, \
             attempts = attempts - 1, worker = NULL, lease_until_ms = NULL \
             WHERE id = $1 AND fence = $2 AND state = 'running'",
        )
        .bind(lease.id.to_string())
        .bind(lease.fence)
        .bind(now_ms())
        .execute(&mut *tx)
        .await?;
        tx.commit().await?;
        Ok(done.rows_affected() > 0)
    }

    /// See `Store::reclaim`.
    pub(crate) async fn reclaim(
        &self,
        which: Reclaim,
        max_attempts: u32,
        held: &[ReconstructionId],
    ) -> Result<Vec<ReconstructionRecord>> {
        let now = now_ms();
        let (before, after) = match which {
            Reclaim::All => (i64::MAX, i64::MAX),
            // Farther away than any lease: the clock was set back.
            Reclaim::Expired => (now, now + LONGEST_LEASE_MS),
        };
        let held = serde_json::to_string(held).map_err(Error::internal)?;
        let mut tx = self.begin().await?;
        let changed = sqlx::query(
            "UPDATE reconstructions SET \
             state = CASE WHEN cancel_requested THEN 'cancelled' WHEN attempts >= $2 THEN 'failed' ELSE 'queued' END, \
             error_code = CASE WHEN cancel_requested THEN error_code ELSE 'worker_died' END, \
             error_detail = CASE WHEN cancel_requested THEN error_detail ELSE $4 END, \
             finished_ms = CASE WHEN cancel_requested OR attempts >= $2 THEN $3 ELSE NULL END, stage = NULL, fraction = 0.0, \
             not_before_ms = $3, wait_ms = 0, worker = NULL, lease_until_ms = NULL \
             WHERE state = 'running' AND (lease_until_ms < $1 OR lease_until_ms > $5) \
             AND id NOT IN (SELECT value FROM json_each($6)) RETURNING *",
        )
        .bind(before)
        .bind(i64::from(max_attempts))
        .bind(now)
        .bind("the process that ran it ended before it was done; if that repeats, look for lack of memory")
        .bind(after)
        .bind(held)
        .fetch_all(&mut *tx)
        .await?;
        tx.commit().await?;
        // One that can't be understood is told of when it is claimed.
        Ok(changed.iter().filter_map(|row| rows::reconstruction(row).ok()).collect())
    }
}
