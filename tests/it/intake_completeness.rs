//! A series is complete once, for a recorded reason, and a complete one becomes one reconstruction.

use std::time::Duration;

use tempfile::tempdir;
use triplanar::dicom::series::UnfitReason;
use triplanar::error::Error;
use triplanar::store::{
    CompleteReason, Fault, ReconstructionFilter, ReconstructionState, SenderEnd, SeriesFilter, SeriesState,
    TransferDoubt,
};
use uuid::Uuid;

use crate::support::entrance::{Entrance, outcome, settings};
use crate::support::slice::Slice;

const LEASE: Duration = Duration::from_secs(60);

async fn reconstructions(entrance: &Entrance, series: u32) -> usize {
    let filter =
        ReconstructionFilter { series_instance_uid: Some(Slice::of(series, 0).series_uid()), state: None };
    entrance.store.list_reconstructions(&filter, None, 100).await.unwrap().rows.len()
}

#[tokio::test]
async fn quiet_alone_completes() {
    let dir = tempdir().unwrap();
    let mut config = settings(dir.path());
    config.intake.quiet = Duration::from_millis(300);
    let entrance = Entrance::open(config).await;
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    let series = entrance.until(1, SeriesState::Complete).await;
    assert_eq!(series.complete_reason, Some(CompleteReason::Quiet));
    assert_eq!((series.revision, reconstructions(&entrance, 1).await), (1, 1));
}

#[tokio::test]
async fn the_end_of_the_last_association_completes() {
    let dir = tempdir().unwrap();
    let mut config = settings(dir.path());
    config.intake.quiet_after_association = Duration::from_millis(100);
    let entrance = Entrance::open(config).await;
    let (first, second) = (Uuid::new_v4(), Uuid::new_v4());
    entrance.send_all(first, 1, 1..4).await;
    entrance.send_all(second, 1, 4..6).await;
    entrance.send_all(second, 2, 11..15).await;
    entrance.intake.association_ended(first).await.unwrap();
    // Long enough for a deadline that should not be there; series 1 is still being sent.
    tokio::time::sleep(Duration::from_millis(400)).await;
    assert_eq!(entrance.series(1).await.state, SeriesState::Receiving);

    entrance.intake.association_ended(second).await.unwrap();
    for series in [1, 2] {
        let series = entrance.until(series, SeriesState::Complete).await;
        assert_eq!(series.complete_reason, Some(CompleteReason::AssociationEnded));
    }
    assert_eq!(entrance.store.queued().await.unwrap(), 2);
}

#[tokio::test]
async fn the_expected_number_completes_whenever_it_was_said() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let before = Slice::of(1, 0).series_uid();
    entrance.intake.expect(&before, 4).await.unwrap();
    entrance.send_all(Uuid::new_v4(), 1, 1..4).await;
    assert_eq!(entrance.series(1).await.state, SeriesState::Receiving);
    assert_eq!(entrance.series(1).await.expected_instances, Some(4));
    entrance.send_all(Uuid::new_v4(), 1, 4..5).await;
    assert_eq!(entrance.series(1).await.complete_reason, Some(CompleteReason::ExpectedInstances));

    // More than were expected: the number was wrong, so that each further one waits for quiet.
    entrance.send_all(Uuid::new_v4(), 1, 5..7).await;
    assert_eq!(entrance.series(1).await.state, SeriesState::Receiving);
    assert_eq!(reconstructions(&entrance, 1).await, 1);

    entrance.send_all(Uuid::new_v4(), 2, 11..15).await;
    entrance.intake.expect(&Slice::of(2, 0).series_uid(), 4).await.unwrap();
    assert_eq!(entrance.series(2).await.complete_reason, Some(CompleteReason::ExpectedInstances));
    assert_eq!(entrance.store.queued().await.unwrap(), 2);
}

#[tokio::test]
async fn the_end_of_an_upload_completes_unless_more_is_expected() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let upload = Uuid::new_v4();
    for slice in (1..5).map(|n| Slice::of(1, n)).chain((11..15).map(|n| Slice::of(2, n))) {
        entrance.upload(upload, &slice.part10()).await.unwrap();
    }
    entrance.intake.expect(&Slice::of(2, 0).series_uid(), 5).await.unwrap();
    let series = entrance.intake.upload_ended(upload).await.unwrap();
    assert_eq!(series, [Slice::of(1, 0).series_uid(), Slice::of(2, 0).series_uid()]);
    assert_eq!(entrance.series(1).await.complete_reason, Some(CompleteReason::UploadEnded));
    assert_eq!(entrance.series(2).await.state, SeriesState::Receiving);

    // The same upload again names the same series and changes nothing.
    let again = Uuid::new_v4();
    for number in 1..5 {
        assert!(entrance.upload(again, &Slice::of(1, number).part10()).await.unwrap().duplicate);
    }
    assert_eq!(entrance.intake.upload_ended(again).await.unwrap(), [Slice::of(1, 0).series_uid()]);
    assert_eq!((entrance.series(1).await.revision, reconstructions(&entrance, 1).await), (1, 1));
}

#[tokio::test]
async fn the_reason_tells_requests_from_associations() {
    let dir = tempdir().unwrap();
    let mut config = settings(dir.path());
    config.intake.quiet_after_association = Duration::ZERO;
    let entrance = Entrance::open(config).await;
    let (association, request) = (Uuid::new_v4(), Uuid::new_v4());
    entrance.send_all(association, 1, 1..5).await;
    for number in 5..9 {
        entrance.upload(request, &Slice::of(2, number).part10()).await.unwrap();
    }
    entrance.intake.association_ended(association).await.unwrap();
    entrance.intake.request_ended(request).await.unwrap();
    for (series, reason) in [(1, CompleteReason::AssociationEnded), (2, CompleteReason::UploadEnded)] {
        assert_eq!(entrance.until(series, SeriesState::Complete).await.complete_reason, Some(reason));
    }
}

#[tokio::test]
async fn what_is_no_head_ct_is_kept_and_makes_no_job() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    entrance.send_all(Uuid::new_v4(), 1, 1..3).await;
    let uid = Slice::of(1, 0).series_uid();
    assert_eq!(entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap(), None);
    let series = entrance.series(1).await;
    assert_eq!(series.state, SeriesState::NotReconstructable);
    assert_eq!(series.unfit_reason, Some(UnfitReason::TooFewSlices));
    assert_eq!(entrance.store.queued().await.unwrap(), 0);
    let detail = entrance.store.unfit_detail(&uid, 4).await.unwrap();
    assert_eq!(detail.as_deref(), Some("2 slices, intake.min_slices is 4"));
    let error = entrance.store.enqueue(&uid, &entrance.config.pipeline, 10).await.unwrap_err();
    assert!(matches!(error, Error::NotReconstructable { .. }), "{error:?}");

    // The slices that were missing make it one.
    entrance.send_all(Uuid::new_v4(), 1, 3..5).await;
    assert_eq!(entrance.series(1).await.unfit_reason, None);
    assert!(entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap().is_some());
    assert_eq!(entrance.series(1).await.revision, 2);

    let error = entrance.intake.complete(&Slice::of(9, 0).series_uid(), CompleteReason::Explicit).await;
    assert!(matches!(error, Err(Error::NotFound { .. })), "{error:?}");
}

#[tokio::test]
async fn a_late_instance_makes_a_revision_that_supersedes_the_old_one() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let uid = Slice::of(1, 0).series_uid();
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    let old = entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap().unwrap();
    let claim = entrance.store.claim("w", LEASE).await.unwrap().unwrap();

    // It comes while the first revision is being worked on.
    entrance.send_all(Uuid::new_v4(), 1, 5..6).await;
    assert_eq!(entrance.series(1).await.state, SeriesState::Receiving);
    assert_eq!(entrance.store.instances_of(&claim.reconstruction).await.unwrap().len(), 4);
    let new = entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap().unwrap();
    assert_ne!(old, new);
    assert!(entrance.store.finish_success(&claim.lease, &outcome("old")).await.unwrap());
    assert_eq!(entrance.store.clinical(&uid).await.unwrap().unwrap().reconstruction.id, old);

    let claim = entrance.store.claim("w", LEASE).await.unwrap().unwrap();
    assert_eq!((claim.reconstruction.id, claim.reconstruction.revision), (new, 2));
    assert_eq!(entrance.store.instances_of(&claim.reconstruction).await.unwrap().len(), 5);
    assert!(entrance.store.finish_success(&claim.lease, &outcome("new")).await.unwrap());

    let superseded = entrance.store.reconstruction(old).await.unwrap().unwrap();
    assert_eq!((superseded.state, superseded.superseded_by), (ReconstructionState::Superseded, Some(new)));
    assert_eq!(entrance.store.cloud(old, None).await.unwrap(), b"old None");
    assert_eq!(entrance.store.cloud(new, None).await.unwrap(), b"new None");
    assert_eq!(entrance.store.clinical(&uid).await.unwrap().unwrap().reconstruction.id, new);
}

#[tokio::test]
async fn an_older_revision_that_ends_last_is_superseded_at_once() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let uid = Slice::of(1, 0).series_uid();
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap();
    entrance.send_all(Uuid::new_v4(), 1, 5..6).await;
    entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap();
    let old = entrance.store.claim("a", LEASE).await.unwrap().unwrap();
    let new = entrance.store.claim("b", LEASE).await.unwrap().unwrap();
    assert!(entrance.store.finish_success(&new.lease, &outcome("new")).await.unwrap());
    assert!(entrance.store.finish_success(&old.lease, &outcome("old")).await.unwrap());
    let old = entrance.store.reconstruction(old.lease.id).await.unwrap().unwrap();
    assert_eq!((old.state, old.superseded_by), (ReconstructionState::Superseded, Some(new.lease.id)));
}

#[tokio::test]
async fn deadlines_and_jobs_survive_a_restart_and_fire_once() {
    let dir = tempdir().unwrap();
    let mut config = settings(dir.path());
    config.intake.quiet = Duration::from_millis(500);
    let entrance = Entrance::open(config).await;
    // Queued before the restart.
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    entrance.intake.complete(&Slice::of(1, 0).series_uid(), CompleteReason::Explicit).await.unwrap();
    // Its association never says that it ended.
    entrance.send_all(Uuid::new_v4(), 2, 11..15).await;
    let entrance = entrance.restart().await;
    let series = entrance.until(2, SeriesState::Complete).await;
    assert_eq!(series.complete_reason, Some(CompleteReason::Quiet));
    assert_eq!(series.sender_end, Some(SenderEnd::ServiceStopped));
    assert_eq!(series.doubts, [TransferDoubt::IncompleteTransfer]);
    let entrance = entrance.restart().await;
    for series in [1, 2] {
        assert_eq!(reconstructions(&entrance, series).await, 1);
    }
    assert_eq!(entrance.store.queued().await.unwrap(), 2);
}

#[tokio::test]
async fn a_full_queue_delays_a_completion_and_loses_none() {
    let dir = tempdir().unwrap();
    let mut config = settings(dir.path());
    config.jobs.max_queued = 1;
    let entrance = Entrance::open(config).await;
    for (series, first) in [(1, 1), (2, 11)] {
        entrance.intake.expect(&Slice::of(series, 0).series_uid(), 4).await.unwrap();
        entrance.send_all(Uuid::new_v4(), series, first..first + 4).await;
    }
    assert_eq!(entrance.series(1).await.state, SeriesState::Complete);
    assert_eq!(entrance.series(2).await.state, SeriesState::Receiving);
    let two = Slice::of(2, 0).series_uid();
    let error = entrance.intake.complete(&two, CompleteReason::Explicit).await.unwrap_err();
    assert!(matches!(error, Error::Busy(_)), "{error:?}");
    let one = Slice::of(1, 0).series_uid();
    let other = triplanar::pipeline::Parameters { leaf_mm: 2.0, ..entrance.config.pipeline.clone() };
    let error = entrance.store.enqueue(&one, &other, 1).await.unwrap_err();
    assert!(matches!(error, Error::Busy(_)), "{error:?}");

    entrance.store.claim("w", LEASE).await.unwrap().expect("the first series' job");
    entrance.until(2, SeriesState::Complete).await;
    assert_eq!(reconstructions(&entrance, 2).await, 1);
}

#[tokio::test]
async fn what_somebody_tries_takes_no_room_and_no_turn_of_the_service_s_own() {
    let dir = tempdir().unwrap();
    let mut config = settings(dir.path());
    config.jobs.max_queued = 3;
    let entrance = Entrance::open(config).await;
    let arrives = async |series: u32| {
        let uid = Slice::of(series, 0).series_uid();
        entrance.intake.expect(&uid, 4).await.unwrap();
        entrance.send_all(Uuid::new_v4(), series, series * 10..series * 10 + 4).await;
        uid
    };
    let one = arrives(1).await;
    let own = entrance.store.claim("w", LEASE).await.unwrap().expect("the first series' job");
    let attempt = async |leaf_mm| {
        let other = triplanar::pipeline::Parameters { leaf_mm, ..entrance.config.pipeline.clone() };
        entrance.store.enqueue(&one, &other, 3).await
    };
    for leaf_mm in [2.0, 2.1, 2.2] {
        attempt(leaf_mm).await.unwrap();
    }
    assert!(matches!(attempt(2.3).await.unwrap_err(), Error::Busy(_)));
    let two = arrives(2).await;
    assert_eq!(entrance.series(2).await.state, SeriesState::Complete, "the queue has room for it");
    let next = entrance.store.claim("w", LEASE).await.unwrap().unwrap();
    assert_eq!(next.reconstruction.series_instance_uid, two, "it is run first");
    let tried = entrance.store.claim("w", LEASE).await.unwrap().unwrap();
    assert_eq!(tried.reconstruction.series_instance_uid, one);
    assert_ne!(tried.lease.id, own.lease.id);
}

#[tokio::test]
async fn lists_go_page_by_page_newest_first() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    for series in 1..6 {
        entrance.send_all(Uuid::new_v4(), series, series * 10..series * 10 + 1).await;
    }
    let (mut seen, mut cursor) = (Vec::new(), None);
    loop {
        let page = entrance.store.list_series(&SeriesFilter::default(), cursor.as_deref(), 2).await.unwrap();
        assert!(page.rows.len() <= 2);
        seen.extend(page.rows.into_iter().map(|series| series.series_instance_uid));
        cursor = page.next_cursor;
        if cursor.is_none() {
            break;
        }
    }
    let expected: Vec<_> = (1..6).rev().map(|series| Slice::of(series, 0).series_uid()).collect();
    assert_eq!(seen, expected);
    let nobody = SeriesFilter { patient_id: Some("nobody".into()), ..Default::default() };
    assert_eq!(entrance.store.list_series(&nobody, None, 9).await.unwrap().rows, []);
    let somebody = SeriesFilter { patient_id: Some("PATIENT-4711".into()), ..Default::default() };
    assert_eq!(entrance.store.list_series(&somebody, None, 9).await.unwrap().rows.len(), 5);
    let error = entrance.store.list_series(&somebody, Some("zz"), 9).await.unwrap_err();
    assert!(matches!(error, Error::InvalidParameter { .. }), "{error:?}");
}

#[tokio::test]
async fn a_failed_reconstruction_keeps_its_report_and_is_queued_again_under_its_id() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let uid = Slice::of(1, 0).series_uid();
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    let id = entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap().unwrap();
    let claim = entrance.store.claim("w", LEASE).await.unwrap().unwrap();
    let fault = Fault {
        code: "empty_cloud".into(),
        detail: "none".into(),
        instances: vec![Slice::of(1, 2).sop_uid()],
    };
    assert!(entrance.store.finish_failure(&claim.lease, &fault, Some(b"{}")).await.unwrap());
    let failed = entrance.store.reconstruction(id).await.unwrap().unwrap();
    assert_eq!(failed.state, ReconstructionState::Failed);
    assert_eq!(failed.error_code.as_deref(), Some("empty_cloud"));
    assert_eq!(failed.error_instances, [Slice::of(1, 2).sop_uid()]);
    assert_eq!(entrance.store.report(id).await.unwrap(), b"{}");
    let error = entrance.store.cloud(id, None).await.unwrap_err();
    assert!(matches!(error, Error::ReconstructionState { state: "failed", .. }), "{error:?}");

    let (again, queued) = entrance.store.enqueue(&uid, &entrance.config.pipeline, 10).await.unwrap();
    assert!(queued);
    assert_eq!((again.id, again.state, again.attempts), (id, ReconstructionState::Queued, 0));
    assert!(!again.has_report && again.error_code.is_none());
    let (same, queued) = entrance.store.enqueue(&uid, &entrance.config.pipeline, 10).await.unwrap();
    assert!(!queued);
    assert_eq!(same.id, id);
}

#[tokio::test]
async fn a_sender_that_broke_off_leaves_a_doubt_until_the_series_is_made_whole() {
    let ends = [
        SenderEnd::AssociationAborted,
        SenderEnd::AssociationLost,
        SenderEnd::UploadBroken,
        SenderEnd::InstancesRefused,
    ];
    for end in ends {
        let dir = tempdir().unwrap();
        let mut config = settings(dir.path());
        config.intake.quiet = Duration::from_millis(600);
        config.intake.quiet_after_association = Duration::ZERO;
        let entrance = Entrance::open(config).await;
        for series in 1..=5 {
            let sender = Uuid::new_v4();
            entrance.send_all(sender, series, series * 10..series * 10 + 4).await;
            entrance.intake.sender_ended(sender, end).await.unwrap();
        }
        for series in 1..=5 {
            // The short quiet time is none at all: it would have been the reason.
            let record = entrance.until(series, SeriesState::Complete).await;
            assert_eq!(record.complete_reason, Some(CompleteReason::Quiet), "{end}");
            assert_eq!(record.sender_end, Some(end));
            assert_eq!(record.doubts, [TransferDoubt::IncompleteTransfer], "{end}");
        }
        let uid = |series| Slice::of(series, 0).series_uid();
        let doubts = async |series| entrance.series(series).await.doubts;
        // By word.
        entrance.intake.complete(&uid(1), CompleteReason::Explicit).await.unwrap();
        assert_eq!(doubts(1).await, []);
        // By count, but not by one that is not reached.
        entrance.intake.expect(&uid(2), 5).await.unwrap();
        assert_eq!(doubts(2).await, [TransferDoubt::IncompleteTransfer]);
        entrance.intake.expect(&uid(2), 4).await.unwrap();
        assert_eq!(doubts(2).await, []);
        // By a sender of the same instances that ended well, and not by one that did not.
        for (again, left) in [(SenderEnd::AssociationLost, 1), (SenderEnd::AssociationReleased, 0)] {
            let sender = Uuid::new_v4();
            entrance.send_all(sender, 3, 30..34).await;
            entrance.intake.sender_ended(sender, again).await.unwrap();
            assert_eq!(doubts(3).await.len(), left, "{again}");
        }
        // By one that brings all that the broken one had brought, and the rest.
        let sender = Uuid::new_v4();
        entrance.send_all(sender, 4, 40..46).await;
        assert_eq!(doubts(4).await.len(), 1);
        entrance.intake.association_ended(sender).await.unwrap();
        let record = entrance.until(4, SeriesState::Complete).await;
        assert_eq!((record.revision, record.complete_reason), (2, Some(CompleteReason::AssociationEnded)));
        assert_eq!(record.doubts, []);
        // By a whole upload.
        let upload = Uuid::new_v4();
        for number in 50..54 {
            entrance.upload(upload, &Slice::of(5, number).part10()).await.unwrap();
        }
        entrance.intake.upload_ended(upload).await.unwrap();
        assert_eq!(doubts(5).await, []);
    }
}

#[tokio::test]
async fn what_was_said_to_be_whole_is_not_doubted_afterwards() {
    let dir = tempdir().unwrap();
    let mut config = settings(dir.path());
    config.intake.quiet_after_association = Duration::ZERO;
    let entrance = Entrance::open(config).await;
    let uid = |series| Slice::of(series, 0).series_uid();
    entrance.intake.expect(&uid(1), 4).await.unwrap();
    entrance.intake.expect(&uid(3), 9).await.unwrap();
    for series in 1..=3 {
        let sender = Uuid::new_v4();
        entrance.send_all(sender, series, series * 10..series * 10 + 4).await;
        if series == 2 {
            entrance.intake.complete(&uid(2), CompleteReason::Explicit).await.unwrap();
        }
        let end = if series == 3 { SenderEnd::AssociationReleased } else { SenderEnd::AssociationAborted };
        entrance.intake.sender_ended(sender, end).await.unwrap();
        let record = entrance.until(series, SeriesState::Complete).await;
        // Nine were announced of the third.
        assert_eq!(record.doubts.len(), usize::from(series == 3), "series {series}");
    }
}
