//! How a running reconstruction goes on and ends.
//!
//! A worker holds it by a lease with a fencing token. Every statement that a worker causes names
//! both, so one that lost its lease (too slow, or thought dead) changes nothing.

use std::time::Duration;

use sqlx::Row as _;

use super::queue::milliseconds;
use super::{Catalog, now_ms, reconstructions, rows};
use crate::error::{Error, Result};
use crate::pipeline::Stage;
use crate::store::queue::{Fault, Heartbeat, Lease, Reclaim};
use crate::store::records::ReconstructionRecord;

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

    /// Marks success; `prefix` is that of the durable result. False: the lease was lost.
    pub(crate) async fn succeed(
        &self,
        lease: &Lease,
        prefix: &str,
        figures: &str,
        quality: Option<&str>,
        has_pictures: bool,
    ) -> Result<bool> {
        let mut tx = self.begin().await?;
        let row = sqlx::query(
            "UPDATE reconstructions SET state = 'succeeded', stage = NULL, fraction = 1.0, figures = $3, result = $4, \
             has_report = TRUE, error_code = NULL, error_detail = NULL, error_instances = '[]', finished_ms = $5, \
             worker = NULL, lease_until_ms = NULL, quality = $6, has_pictures = $7 \
             WHERE id = $1 AND fence = $2 AND state = 'running' RETURNING *",
        )
        .bind(lease.id.to_string())
        .bind(lease.fence)
        .bind(figures)
        .bind(prefix)
        .bind(now_ms())
        .bind(quality)
        .bind(has_pictures)
        .fetch_optional(&mut *tx)
        .await?;
        let Some(row) = row else { return Ok(false) };
        reconstructions::supersede(&mut tx, &row).await?;
        tx.commit().await?;
        Ok(true)
    }

    /// Marks failure; `prefix` is that of the durable report, if there is one. False: the lease
    /// was lost.
    pub(crate) async fn fail(
        &self,
        lease: &Lease,
        fault: &Fault,
        prefix: Option<&str>,
        has_pictures: bool,
    ) -> Result<bool> {
        let instances = serde_json::to_string(&fault.instances).map_err(Error::internal)?;
        let mut tx = self.begin().await?;
        let done = sqlx::query(
            "UPDATE reconstructions SET state = 'failed', stage = NULL, fraction = 0.0, error_code = $3, error_detail = $4, error_instances = $5, \
             result = $6, has_report = ($6 IS NOT NULL), has_pictures = $8, finished_ms = $7, worker = NULL, lease_until_ms = NULL \
             WHERE id = $1 AND fence = $2 AND state = 'running'",
        )
        .bind(lease.id.to_string())
        .bind(lease.fence)
        .bind(&fault.code)
        .bind(&fault.detail)
        .bind(instances)
        .bind(prefix)
        .bind(now_ms())
        .bind(has_pictures)
        .execute(&mut *tx)
        .await?;
        tx.commit().await?;
        Ok(done.rows_affected() > 0)
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
    pub(crate) async fn retry(&self, lease: &Lease, not_before_ms: i64, fault: &Fault) -> Result<bool> {
        let mut tx = self.begin().await?;
        let done = sqlx::query(
            "UPDATE reconstructions SET state = CASE WHEN cancel_requested THEN 'cancelled' ELSE 'queued' END, \
             finished_ms = CASE WHEN cancel_requested THEN $6 ELSE NULL END, stage = NULL, fraction = 0.0, \
             not_before_ms = $3, error_code = $4, error_detail = $5, worker = NULL, lease_until_ms = NULL \
             WHERE id = $1 AND fence = $2 AND state = 'running'",
        )
        .bind(lease.id.to_string())
        .bind(lease.fence)
        .bind(not_before_ms)
        .bind(&fault.code)
        .bind(&fault.detail)
        .bind(now_ms())
        .execute(&mut *tx)
        .await?;
        tx.commit().await?;
        Ok(done.rows_affected() > 0)
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
    ) -> Result<Vec<ReconstructionRecord>> {
        let now = now_ms();
        let before = match which {
            Reclaim::All => i64::MAX,
            Reclaim::Expired => now,
        };
        let mut tx = self.begin().await?;
        let changed = sqlx::query(
            "UPDATE reconstructions SET \
             state = CASE WHEN cancel_requested THEN 'cancelled' WHEN attempts >= $2 THEN 'failed' ELSE 'queued' END, \
             error_code = CASE WHEN cancel_requested THEN error_code ELSE 'worker_died' END, \
             error_detail = CASE WHEN cancel_requested THEN error_detail ELSE $4 END, \
             finished_ms = CASE WHEN cancel_requested OR attempts >= $2 THEN $3 ELSE NULL END, stage = NULL, fraction = 0.0, \
             not_before_ms = $3, worker = NULL, lease_until_ms = NULL \
             WHERE state = 'running' AND lease_until_ms < $1 RETURNING *",
        )
        .bind(before)
        .bind(i64::from(max_attempts))
        .bind(now)
        .bind("the process that ran it ended before it was done; if that repeats, look for lack of memory")
        .fetch_all(&mut *tx)
        .await?;
        tx.commit().await?;
        // One that can't be understood is told of when it is claimed.
        Ok(changed.iter().filter_map(|row| rows::reconstruction(row).ok()).collect())
    }
}
