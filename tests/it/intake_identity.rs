//! Stored instances that come again with a corrected identity: replaced durably, told, and no cloud
//! until every instance carries the new one.

use std::path::Path;
use std::time::Duration;

use tempfile::tempdir;
use triplanar::config::ChangedIdentity;
use triplanar::dicom::identity::IdentityField;
use triplanar::dicom::source::InstanceSource as _;
use triplanar::error::Error;
use triplanar::pipeline::Parameters;
use triplanar::store::{CompleteReason, ReconstructionId, SeriesFilter};
use uuid::Uuid;

use crate::support::entrance::{Entrance, outcome, settings};
use crate::support::slice::Slice;

const CORRECTED: &str = "PATIENT-0815";

fn corrected(number: u32) -> Slice {
    Slice { patient_id: CORRECTED, ..Slice::of(1, number) }
}

/// The files of all stored instances.
fn blobs(data_dir: &Path) -> usize {
    let folders = std::fs::read_dir(data_dir.join("instances")).unwrap();
    folders.map(|folder| std::fs::read_dir(folder.unwrap().path()).unwrap().count()).sum()
}

/// Four slices, complete, with their reconstruction waiting.
async fn complete(entrance: &Entrance) -> ReconstructionId {
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    let uid = Slice::of(1, 1).series_uid();
    entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap().expect("a reconstruction")
}

async fn found(entrance: &Entrance, patient_id: &str) -> usize {
    let filter = SeriesFilter { patient_id: Some(patient_id.to_owned()), ..SeriesFilter::default() };
    entrance.store.list_series(&filter, None, 10).await.unwrap().rows.len()
}

async fn claimed(entrance: &Entrance) -> Option<ReconstructionId> {
    let claim = entrance.store.claim("test", Duration::from_secs(60)).await.unwrap();
    claim.map(|claim| claim.reconstruction.id)
}

#[tokio::test]
async fn a_corrected_identity_is_kept_told_and_found_once_every_instance_carries_it() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let uid = Slice::of(1, 1).series_uid();
    let id = complete(&entrance).await;
    let claim = entrance.store.claim("test", Duration::from_secs(60)).await.unwrap().expect("the job");
    assert!(entrance.store.finish_success(&claim.lease, &outcome("first")).await.unwrap());

    for number in 1..3 {
        let receipt = entrance.send(Uuid::new_v4(), &corrected(number)).await.unwrap();
        assert!(!receipt.duplicate);
    }
    let entrance = entrance.restart().await;
    let series = entrance.series(1).await;
    assert!(series.identity_changing, "it survives a restart");
    assert_eq!((series.patient_id.as_deref(), series.revision), (Some("PATIENT-4711"), 1));
    assert_eq!((found(&entrance, "PATIENT-4711").await, found(&entrance, CORRECTED).await), (1, 0));
    assert!(entrance.store.identity_changes(&uid).await.unwrap().is_empty());
    assert_eq!(blobs(dir.path()), 4, "the former data sets are gone");

    for number in 3..5 {
        entrance.send(Uuid::new_v4(), &corrected(number)).await.unwrap();
    }
    let series = entrance.series(1).await;
    assert!(!series.identity_changing);
    assert_eq!((series.patient_id.as_deref(), series.revision), (Some(CORRECTED), 1));
    assert_eq!((found(&entrance, "PATIENT-4711").await, found(&entrance, CORRECTED).await), (0, 1));
    let changes = entrance.store.identity_changes(&uid).await.unwrap();
    assert_eq!(changes.len(), 1);
    assert_eq!(changes[0].fields, [IdentityField::PatientId]);

    let instances = entrance.store.instances(&uid).await.unwrap();
    let source = entrance.store.instance_source(&instances);
    for (index, number) in (1..5).enumerate() {
        let file = source.read(index).unwrap();
        assert!(file.ends_with(&corrected(number).data_set()), "the new data set is stored");
    }
    assert_eq!(series.bytes, instances.iter().map(|instance| instance.size).sum::<u64>());
    assert_eq!(blobs(dir.path()), 4);

    // The reconstruction is of the same pixels: it stands, and is what the same wish gives.
    let record = entrance.store.reconstruction(id).await.unwrap().expect("it is there");
    assert_eq!(entrance.store.instances_of(&record).await.unwrap().len(), 4);
    let (same, queued) = entrance.store.enqueue(&uid, &Parameters::paper(), 10).await.unwrap();
    assert_eq!((same.id, queued), (id, false));
}

#[tokio::test]
async fn a_correction_that_is_sent_back_is_over_without_the_rest() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    complete(&entrance).await;
    entrance.send(Uuid::new_v4(), &corrected(2)).await.unwrap();
    assert!(entrance.series(1).await.identity_changing);
    // The others as they are stored: that does not make them the corrected patient's.
    for number in [1, 3, 4] {
        assert!(entrance.send(Uuid::new_v4(), &Slice::of(1, number)).await.unwrap().duplicate);
    }
    assert!(entrance.series(1).await.identity_changing);
    entrance.send(Uuid::new_v4(), &Slice::of(1, 2)).await.unwrap();
    let series = entrance.series(1).await;
    assert!(!series.identity_changing);
    assert_eq!(series.patient_id.as_deref(), Some("PATIENT-4711"));
}

#[tokio::test]
async fn no_reconstruction_begins_while_the_identity_is_changing() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let id = complete(&entrance).await;
    entrance.send(Uuid::new_v4(), &corrected(1)).await.unwrap();
    assert_eq!(claimed(&entrance).await, None);
    assert_eq!(entrance.store.next_claim_ms().await.unwrap(), None);
    for number in 2..5 {
        entrance.send(Uuid::new_v4(), &corrected(number)).await.unwrap();
    }
    assert_eq!(claimed(&entrance).await, Some(id));
}

#[tokio::test]
async fn a_replaced_data_set_stays_as_long_as_a_reconstruction_may_read_it() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    complete(&entrance).await;
    let claim = entrance.store.claim("test", Duration::from_secs(60)).await.unwrap().expect("the job");
    let read = entrance.store.instances_of(&claim.reconstruction).await.unwrap();
    for number in 1..5 {
        entrance.send(Uuid::new_v4(), &corrected(number)).await.unwrap();
    }
    assert_eq!(entrance.store.instance_source(&read).read(0).unwrap(), Slice::of(1, 1).stored());
    assert!(entrance.store.finish_success(&claim.lease, &outcome("first")).await.unwrap());
    entrance.store.sweep(0).await.unwrap();
    assert_eq!(blobs(dir.path()), 4);
}

#[tokio::test]
async fn two_senders_of_two_corrections_leave_one_of_them_whole() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    complete(&entrance).await;
    let other = |number| Slice { patient_id: "PATIENT-9999", ..Slice::of(1, number) };
    for number in 1..5 {
        let (one, two) = (corrected(number), other(number));
        let sent = futures_util::future::join(
            entrance.send(Uuid::new_v4(), &one),
            entrance.send(Uuid::new_v4(), &two),
        );
        let (one, two) = sent.await;
        assert!(one.is_ok() && two.is_ok(), "{one:?} {two:?}");
    }
    let instances = entrance.store.instances(&Slice::of(1, 1).series_uid()).await.unwrap();
    let source = entrance.store.instance_source(&instances);
    for (index, number) in (1..5).enumerate() {
        let bytes = source.read(index).unwrap();
        let sent = [corrected(number).data_set(), other(number).data_set()];
        assert!(sent.iter().any(|data_set| bytes.ends_with(data_set)));
    }
    assert_eq!(blobs(dir.path()), 4);
}

#[tokio::test]
async fn corrections_can_be_refused() {
    let dir = tempdir().unwrap();
    let mut config = settings(dir.path());
    config.intake.changed_identity = ChangedIdentity::Refuse;
    let entrance = Entrance::open(config).await;
    complete(&entrance).await;
    let error = entrance.send(Uuid::new_v4(), &corrected(1)).await.unwrap_err();
    assert!(matches!(error, Error::ConflictingIdentity(_)), "{error:?}");
    assert_eq!((error.mapping().dimse_status, error.mapping().http_status), (0xC008, 409));
    assert!(!error.to_string().contains(CORRECTED) && !error.to_string().contains("4711"), "{error}");
    let series = entrance.series(1).await;
    assert!(!series.identity_changing);
    assert_eq!((series.patient_id.as_deref(), series.refused_instances), (Some("PATIENT-4711"), 1));
    assert_eq!(blobs(dir.path()), 4);
}

#[tokio::test]
async fn a_series_of_two_patients_has_the_identity_of_neither() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    entrance.send_all(Uuid::new_v4(), 1, 1..3).await;
    for number in 3..5 {
        entrance.send(Uuid::new_v4(), &corrected(number)).await.unwrap();
    }
    let uid = Slice::of(1, 1).series_uid();
    entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap();
    let series = entrance.series(1).await;
    assert_eq!((series.patient_id, series.identity_changing), (None, false));
    // What failed for that waits again once it is one patient's.
    let claim = entrance.store.claim("test", Duration::from_secs(60)).await.unwrap().expect("the job");
    let fault =
        triplanar::store::Fault { code: "mixed_patient".into(), detail: "two".into(), instances: Vec::new() };
    assert!(entrance.store.finish_failure(&claim.lease, &fault, None).await.unwrap());
    for number in 1..3 {
        entrance.send(Uuid::new_v4(), &corrected(number)).await.unwrap();
    }
    assert_eq!(entrance.series(1).await.patient_id.as_deref(), Some(CORRECTED));
    assert_eq!(claimed(&entrance).await, Some(claim.reconstruction.id));
}

/// The slice with other attributes that nothing here reads.
fn commented(number: u32) -> Slice {
    Slice { comments: "ZQ-COMMENT", ..Slice::of(1, number) }
}

#[tokio::test]
async fn other_attributes_are_kept_and_told_without_a_change_of_identity_or_revision() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let uid = Slice::of(1, 1).series_uid();
    let id = complete(&entrance).await;
    let claim = entrance.store.claim("test", Duration::from_secs(60)).await.unwrap().expect("the job");
    assert!(entrance.store.finish_success(&claim.lease, &outcome("first")).await.unwrap());
    for number in 1..4 {
        let receipt = entrance.send(Uuid::new_v4(), &commented(number)).await.unwrap();
        assert!(!receipt.duplicate);
        assert!(!entrance.series(1).await.identity_changing);
    }
    // Again as it is stored now, and in another transfer syntax.
    assert!(entrance.send(Uuid::new_v4(), &commented(1)).await.unwrap().duplicate);
    let implicit = Slice { syntax: crate::support::slice::IMPLICIT, ..commented(1) };
    assert!(entrance.send(Uuid::new_v4(), &implicit).await.unwrap().duplicate);

    let entrance = entrance.restart().await;
    let series = entrance.series(1).await;
    assert_eq!((series.revision, series.instances), (1, 4));
    assert!(entrance.store.identity_changes(&uid).await.unwrap().is_empty());
    let changes = entrance.store.attribute_changes(&uid).await.unwrap();
    assert_eq!(changes.iter().map(|change| change.instances).collect::<Vec<_>>(), [3]);
    let instances = entrance.store.instances(&uid).await.unwrap();
    let source = entrance.store.instance_source(&instances);
    for (index, number) in (1..4).enumerate() {
        assert!(source.read(index).unwrap().ends_with(&commented(number).data_set()), "it is stored");
    }
    assert!(source.read(3).unwrap().ends_with(&Slice::of(1, 4).data_set()));
    assert_eq!(series.bytes, instances.iter().map(|instance| instance.size).sum::<u64>());
    assert_eq!(blobs(dir.path()), 4, "the former data sets are gone");
    // The reconstruction is of the same pixels.
    let (same, queued) = entrance.store.enqueue(&uid, &Parameters::paper(), 10).await.unwrap();
    assert_eq!((same.id, queued), (id, false));
    // With the identity they are a correction of that.
    entrance.send(Uuid::new_v4(), &Slice { comments: "", ..corrected(1) }).await.unwrap();
    assert!(entrance.series(1).await.identity_changing);
}

#[tokio::test]
async fn other_attributes_under_which_it_is_no_slice_are_a_conflict() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    complete(&entrance).await;
    let error =
        entrance.send(Uuid::new_v4(), &Slice { modality: "MR", ..Slice::of(1, 1) }).await.unwrap_err();
    assert!(matches!(error, Error::ConflictingInstance(_)), "{error:?}");
}

#[tokio::test]
async fn a_picture_in_another_transfer_syntax_is_a_conflict_of_its_own_name() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let picture = Slice { samples: 3, ..Slice::of(1, 1) };
    entrance.send(Uuid::new_v4(), &picture).await.unwrap();
    assert!(entrance.send(Uuid::new_v4(), &picture).await.unwrap().duplicate);
    let implicit = Slice { syntax: crate::support::slice::IMPLICIT, ..picture.clone() };
    let error = entrance.send(Uuid::new_v4(), &implicit).await.unwrap_err();
    assert!(matches!(error, Error::IncomparableInstance(_)), "{error:?}");
    assert_eq!((error.mapping().dimse_status, error.mapping().http_status), (0xC009, 409));
    assert!(error.to_string().contains("transfer syntax"), "{error}");
    // With another identity in the same one it is a correction.
    let corrected = Slice { patient_id: CORRECTED, ..picture };
    assert!(!entrance.send(Uuid::new_v4(), &corrected).await.unwrap().duplicate);
}
