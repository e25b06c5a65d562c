//! The queue: who holds a job, who has lost it, and how often it is tried.

use std::time::Duration;

use tempfile::tempdir;
use triplanar::error::Error;
use triplanar::observer::Stage;
use triplanar::pipeline::Parameters;
use triplanar::store::{CompleteReason, Fault, Heartbeat, Reclaim, ReconstructionId, ReconstructionState};
use uuid::Uuid;

use crate::support::entrance::{Entrance, outcome, settings};
use crate::support::slice::Slice;

const LEASE: Duration = Duration::from_secs(60);
const OVER: Duration = Duration::ZERO;

async fn one_job() -> (tempfile::TempDir, Entrance, ReconstructionId) {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    let uid = Slice::of(1, 0).series_uid();
    let id = entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap().unwrap();
    (dir, entrance, id)
}

async fn state(entrance: &Entrance, id: ReconstructionId) -> ReconstructionState {
    entrance.store.reconstruction(id).await.unwrap().unwrap().state
}

/// Waits past the millisecond in which a lease of no length ends.
async fn expire() {
    tokio::time::sleep(Duration::from_millis(5)).await;
}

#[tokio::test]
async fn a_job_is_claimed_by_one_worker() {
    let (_dir, entrance, id) = one_job().await;
    let store = &entrance.store;
    assert!(store.next_claim_ms().await.unwrap().is_some());
    let claims = futures_util::future::join_all((0..4).map(|_| store.claim("w", LEASE))).await;
    let claims: Vec<_> = claims.into_iter().filter_map(|claim| claim.unwrap()).collect();
    assert_eq!(claims.len(), 1);
    assert_eq!((claims[0].lease.id, claims[0].reconstruction.attempts), (id, 1));
    assert_eq!(claims[0].reconstruction.state, ReconstructionState::Running);
    assert_eq!(store.next_claim_ms().await.unwrap(), None);

    let beat = store.heartbeat(&claims[0].lease, Stage::Sagittal, 0.5, LEASE).await.unwrap();
    assert_eq!(beat, Heartbeat::Ours);
    let record = store.reconstruction(id).await.unwrap().unwrap();
    assert_eq!((record.stage, record.fraction), (Some(Stage::Sagittal), 0.5));
}

#[tokio::test]
async fn a_worker_that_lost_its_lease_changes_nothing() {
    let (dir, entrance, id) = one_job().await;
    let store = &entrance.store;
    let slow = store.claim("slow", OVER).await.unwrap().unwrap();
    expire().await;
    let reclaimed = store.reclaim(Reclaim::Expired, 3, &[]).await.unwrap();
    assert_eq!(reclaimed.len(), 1);
    assert_eq!(reclaimed[0].state, ReconstructionState::Queued);
    let quick = store.claim("quick", LEASE).await.unwrap().unwrap();
    assert!(quick.lease.fence > slow.lease.fence);

    assert_eq!(store.heartbeat(&slow.lease, Stage::Axial, 0.1, LEASE).await.unwrap(), Heartbeat::Lost);
    assert!(!store.finish_success(&slow.lease, &outcome("slow")).await.unwrap());
    let fault = Fault { code: "x".into(), detail: "x".into(), instances: vec![] };
    assert!(!store.finish_failure(&slow.lease, &fault, Some(b"{}")).await.unwrap());
    assert!(!store.retry(&slow.lease, Duration::ZERO, &fault).await.unwrap());
    assert!(!store.release(&slow.lease).await.unwrap());
    assert!(!store.finish_cancelled(&slow.lease).await.unwrap());

    assert!(store.finish_success(&quick.lease, &outcome("quick")).await.unwrap());
    assert_eq!(store.cloud(id, None).await.unwrap(), b"quick None");
    assert_eq!(store.report(id).await.unwrap(), b"{\"cloud\":\"quick\"}");
    let attempts = std::fs::read_dir(dir.path().join("results").join(id.to_string())).unwrap().count();
    assert_eq!(attempts, 1, "what the slow worker wrote is removed");
    let record = store.reconstruction(id).await.unwrap().unwrap();
    assert_eq!((record.stage, record.fraction), (None, 1.0));
    assert_eq!(record.figures.unwrap().merged, 7);
    assert!(store.claim("w", LEASE).await.unwrap().is_none());
}

#[tokio::test]
async fn a_job_that_kills_its_worker_fails_after_the_last_attempt() {
    let (_dir, mut entrance, id) = one_job().await;
    for attempt in 1..=3 {
        let claim = entrance.store.claim("w", LEASE).await.unwrap().unwrap();
        assert_eq!(claim.reconstruction.attempts, attempt);
        entrance = entrance.restart().await;
        let reclaimed = entrance.store.reclaim(Reclaim::All, 3, &[]).await.unwrap();
        assert_eq!(reclaimed.len(), 1);
    }
    let record = entrance.store.reconstruction(id).await.unwrap().unwrap();
    assert_eq!(record.state, ReconstructionState::Failed);
    assert_eq!(record.error_code.as_deref(), Some("worker_died"));
    assert!(record.finished_ms.is_some());
    assert!(entrance.store.claim("w", LEASE).await.unwrap().is_none());
}

#[tokio::test]
async fn what_has_ended_without_a_cloud_is_in_no_stage() {
    let fault = Fault { code: "empty_cloud".into(), detail: "x".into(), instances: vec![] };
    for end in 0..4 {
        let (_dir, entrance, id) = one_job().await;
        let store = &entrance.store;
        let lease = store.claim("w", if end == 3 { OVER } else { LEASE }).await.unwrap().unwrap().lease;
        store.heartbeat(&lease, Stage::Sagittal, 0.5, if end == 3 { OVER } else { LEASE }).await.unwrap();
        match end {
            0 => assert!(store.finish_failure(&lease, &fault, None).await.unwrap()),
            1 => assert!(store.finish_cancelled(&lease).await.unwrap()),
            2 => assert!(store.retry(&lease, Duration::ZERO, &fault).await.unwrap()),
            _ => {
                expire().await;
                assert_eq!(store.reclaim(Reclaim::Expired, 1, &[]).await.unwrap().len(), 1);
            }
        }
        let record = store.reconstruction(id).await.unwrap().unwrap();
        assert_ne!(record.state, ReconstructionState::Running);
        assert_eq!((record.stage, record.fraction), (None, 0.0), "{:?}", record.state);
    }
}

#[tokio::test]
async fn a_living_lease_is_not_reclaimed() {
    let (_dir, entrance, id) = one_job().await;
    entrance.store.claim("w", LEASE).await.unwrap().unwrap();
    expire().await;
    assert_eq!(entrance.store.reclaim(Reclaim::Expired, 3, &[]).await.unwrap(), []);
    assert_eq!(state(&entrance, id).await, ReconstructionState::Running);
}

#[tokio::test]
async fn a_retry_waits_and_a_release_is_not_counted() {
    let (_dir, entrance, id) = one_job().await;
    let store = &entrance.store;
    let claim = store.claim("w", LEASE).await.unwrap().unwrap();
    assert!(store.release(&claim.lease).await.unwrap());
    let claim = store.claim("w", LEASE).await.unwrap().unwrap();
    assert_eq!(claim.reconstruction.attempts, 1);

    let fault = Fault { code: "internal".into(), detail: "a passing fault".into(), instances: vec![] };
    let far = Duration::from_secs(3_600);
    assert!(store.retry(&claim.lease, far, &fault).await.unwrap());
    assert!(store.claim("w", LEASE).await.unwrap().is_none());
    let due = store.next_claim_ms().await.unwrap().expect("it waits");
    assert!(due > jiff::Timestamp::now().as_millisecond() + 3_000_000, "{due}");
    let record = store.reconstruction(id).await.unwrap().unwrap();
    assert_eq!((record.state, record.error_code.as_deref()), (ReconstructionState::Queued, Some("internal")));
}

#[tokio::test]
async fn cancelling_stops_a_queued_job_at_once_and_a_running_one_at_its_heartbeat() {
    let (_dir, entrance, id) = one_job().await;
    let store = &entrance.store;
    let uid = Slice::of(1, 0).series_uid();
    assert_eq!(store.cancel(id).await.unwrap().state, ReconstructionState::Cancelled);
    assert!(store.claim("w", LEASE).await.unwrap().is_none());

    let (again, queued) = store.enqueue(&uid, &entrance.config.pipeline, 10).await.unwrap();
    assert!(queued && again.id == id);
    let claim = store.claim("w", LEASE).await.unwrap().unwrap();
    assert_eq!(store.cancel(id).await.unwrap().state, ReconstructionState::Running);
    let beat = store.heartbeat(&claim.lease, Stage::Axial, 0.2, LEASE).await.unwrap();
    assert_eq!(beat, Heartbeat::CancelRequested);
    assert!(store.finish_cancelled(&claim.lease).await.unwrap());
    assert_eq!(store.cancel(id).await.unwrap().state, ReconstructionState::Cancelled);
    let error = store.cancel(ReconstructionId::new()).await.unwrap_err();
    assert!(matches!(error, Error::NotFound { .. }), "{error:?}");
}

#[tokio::test]
async fn other_parameters_are_another_reconstruction_and_the_same_ones_are_not() {
    let (_dir, entrance, id) = one_job().await;
    let store = &entrance.store;
    let uid = Slice::of(1, 0).series_uid();
    let other = Parameters { leaf_mm: 0.5, ..entrance.config.pipeline.clone() };
    let (first, new) = store.enqueue(&uid, &other, 10).await.unwrap();
    let (second, again) = store.enqueue(&uid, &other, 10).await.unwrap();
    assert!(new && !again);
    assert_eq!(first.id, second.id);
    assert_ne!(first.id, id);
    let claim = store.claim("w", LEASE).await.unwrap().unwrap();
    assert_eq!(claim.lease.id, id, "the one that waited longest");
    assert!(store.finish_success(&claim.lease, &outcome("a")).await.unwrap());
    let claim = store.claim("w", LEASE).await.unwrap().unwrap();
    assert_eq!(claim.reconstruction.parameters, other);
    assert!(store.finish_success(&claim.lease, &outcome("b")).await.unwrap());
    assert_eq!(
        state(&entrance, id).await,
        ReconstructionState::Succeeded,
        "other parameters supersede nothing"
    );
    let error = store.enqueue(&Slice::of(9, 0).series_uid(), &other, 10).await.unwrap_err();
    assert!(matches!(error, Error::NotFound { .. }), "{error:?}");
}

#[tokio::test]
async fn a_shortage_costs_no_attempt_and_after_its_time_the_job_fails_by_name() {
    let (_dir, entrance, id) = one_job().await;
    let store = &entrance.store;
    let fault = Fault { code: "out_of_storage".into(), detail: "the disk is full".into(), instances: vec![] };
    let waits = (Duration::ZERO, Duration::ZERO);
    for _ in 0..5 {
        let claim = store.claim("w", LEASE).await.unwrap().expect("it may be claimed again");
        assert_eq!(claim.reconstruction.attempts, 1);
        assert!(store.defer(&claim.lease, waits, Duration::from_secs(86_400), &fault).await.unwrap());
        let record = store.reconstruction(id).await.unwrap().unwrap();
        assert_eq!((record.state, record.attempts), (ReconstructionState::Queued, 0));
        assert_eq!(record.error_code.as_deref(), Some("out_of_storage"));
    }
    let claim = store.claim("w", LEASE).await.unwrap().unwrap();
    assert!(store.defer(&claim.lease, waits, Duration::ZERO, &fault).await.unwrap());
    let record = store.reconstruction(id).await.unwrap().unwrap();
    assert_eq!(
        (record.state, record.error_code.as_deref()),
        (ReconstructionState::Failed, Some("out_of_storage"))
    );
    assert!(record.error_detail.unwrap().starts_with("the disk is full"));
}

#[tokio::test]
async fn what_this_process_holds_has_not_lost_its_worker() {
    let (_dir, entrance, id) = one_job().await;
    let store = &entrance.store;
    store.claim("w", OVER).await.unwrap().unwrap();
    expire().await;
    assert_eq!(store.reclaim(Reclaim::Expired, 3, &[id]).await.unwrap(), []);
    assert_eq!(store.reclaim(Reclaim::Expired, 3, &[]).await.unwrap().len(), 1);
}
