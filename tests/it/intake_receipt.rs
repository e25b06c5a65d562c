//! An instance is durable when it is acknowledged, once, and what is refused leaves nothing.

use std::path::Path;

use tempfile::tempdir;
use triplanar::dicom::source::InstanceSource as _;
use triplanar::error::Error;
use triplanar::intake::{Announced, Encoding, Sender};
use triplanar::store::{CompleteReason, SeriesState};
use uuid::Uuid;

use crate::support::entrance::{Entrance, settings};
use crate::support::slice::{EXPLICIT, IMPLICIT, Slice};

/// The files of all stored instances.
fn blobs(data_dir: &Path) -> usize {
    let folders = std::fs::read_dir(data_dir.join("instances")).unwrap();
    folders.map(|folder| std::fs::read_dir(folder.unwrap().path()).unwrap().count()).sum()
}

fn unfinished(data_dir: &Path) -> usize {
    std::fs::read_dir(data_dir.join("incoming")).unwrap().count()
}

#[tokio::test]
async fn a_stored_instance_is_our_header_and_the_untouched_data_set() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let slice = Slice::default();
    let receipt = entrance.send(Uuid::new_v4(), &slice).await.unwrap();
    assert!(!receipt.duplicate);
    assert_eq!(receipt.header.sop_instance_uid, slice.sop_uid());

    let entrance = entrance.restart().await;
    let instances = entrance.store.instances(&slice.series_uid()).await.unwrap();
    assert_eq!(instances.len(), 1);
    assert_eq!(instances[0].header, receipt.header);
    assert_eq!(entrance.store.instance_source(&instances).read(0).unwrap(), slice.stored());
    assert_eq!(instances[0].size, slice.stored().len() as u64);
    assert_eq!(unfinished(dir.path()), 0);
}

#[tokio::test]
async fn an_uploaded_file_is_stored_with_our_header_in_place_of_its_own() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let slice = Slice::default();
    let mut file = slice.part10();
    file[..9].copy_from_slice(b"#!/bin/sh");
    entrance.upload(Uuid::new_v4(), &file).await.unwrap();
    let instances = entrance.store.instances(&slice.series_uid()).await.unwrap();
    assert_eq!(entrance.store.instance_source(&instances).read(0).unwrap(), slice.stored());
}

#[tokio::test]
async fn an_instance_larger_than_the_memory_buffer_arrives_whole() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let slice = Slice { edge: 1_100, ..Slice::default() };
    entrance.send(Uuid::new_v4(), &slice).await.unwrap();
    let instances = entrance.store.instances(&slice.series_uid()).await.unwrap();
    assert_eq!(entrance.store.instance_source(&instances).read(0).unwrap(), slice.stored());
}

#[tokio::test]
async fn the_same_bytes_again_are_a_duplicate_and_make_no_second_job() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    entrance.send_all(Uuid::new_v4(), 1, 1..5).await;
    let uid = Slice::of(1, 1).series_uid();
    let id =
        entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap().expect("a reconstruction");

    let receipt = entrance.send(Uuid::new_v4(), &Slice::of(1, 2)).await.unwrap();
    assert!(receipt.duplicate);
    let series = entrance.series(1).await;
    assert_eq!((series.state, series.revision, series.instances), (SeriesState::Complete, 1, 4));
    assert_eq!(entrance.intake.complete(&uid, CompleteReason::Explicit).await.unwrap(), Some(id));
    assert_eq!(entrance.store.queued().await.unwrap(), 1);
    assert_eq!(blobs(dir.path()), 4);
}

#[tokio::test]
async fn other_pixels_under_a_stored_uid_are_refused_and_told_of() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let slice = Slice::default();
    entrance.send(Uuid::new_v4(), &slice).await.unwrap();
    let other = Slice { value: 41, ..slice.clone() };
    for _ in 0..2 {
        let error = entrance.send(Uuid::new_v4(), &other).await.unwrap_err();
        assert!(matches!(error, Error::ConflictingInstance(_)), "{error:?}");
    }
    let refused = entrance.store.refused(&slice.series_uid()).await.unwrap();
    assert_eq!(refused.len(), 1);
    assert_eq!((refused[0].code.as_str(), refused[0].times), ("conflicting-instance", 2));
    assert_eq!(refused[0].sop_instance_uid, slice.sop_uid());
    assert_eq!(entrance.series(1).await.refused_instances, 1);
    let instances = entrance.store.instances(&slice.series_uid()).await.unwrap();
    assert_eq!(entrance.store.instance_source(&instances).read(0).unwrap(), slice.stored());
    assert_eq!(blobs(dir.path()), 1);
}

#[tokio::test]
async fn an_instance_that_breaks_off_is_told_of_in_its_series() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let upload = Uuid::now_v7();
    entrance.upload(upload, &Slice::of(1, 0).part10()).await.unwrap();
    let broken = Slice::of(1, 1).part10();
    let error = entrance.upload(upload, &broken[..broken.len() - 10]).await.unwrap_err();
    assert_eq!(error.mapping().code, "malformed-data-set");
    let refused = entrance.store.refused(&Slice::of(1, 1).series_uid()).await.unwrap();
    let told: Vec<_> = refused.iter().map(|it| (it.sop_instance_uid.clone(), it.code.as_str())).collect();
    assert_eq!(told, [(Slice::of(1, 1).sop_uid(), "malformed-data-set")]);
    assert_eq!(entrance.series(1).await.refused_instances, 1);
}

#[tokio::test]
async fn the_same_pixels_in_another_transfer_syntax_are_a_duplicate() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let slice = Slice::default();
    entrance.send(Uuid::new_v4(), &slice).await.unwrap();
    let receipt = entrance.send(Uuid::new_v4(), &Slice { syntax: IMPLICIT, ..slice.clone() }).await.unwrap();
    assert!(receipt.duplicate);
    let instances = entrance.store.instances(&slice.series_uid()).await.unwrap();
    assert_eq!(instances[0].header.transfer_syntax_uid.as_str(), EXPLICIT);
    assert_eq!(blobs(dir.path()), 1);
}

#[tokio::test]
async fn a_stored_uid_in_another_series_or_a_series_in_another_study_is_refused() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    entrance.send(Uuid::new_v4(), &Slice::of(1, 1)).await.unwrap();
    let error = entrance.send(Uuid::new_v4(), &Slice::of(2, 1)).await.unwrap_err();
    assert!(matches!(error, Error::ConflictingSeries(_)), "{error:?}");

    // The series UID of study 1, written into a data set of study 3.
    let own = Slice { number: 2, ..Slice::default() };
    let foreign = Slice { study: 3, ..own.clone() };
    let (series, claimed) = (foreign.series_uid(), own.series_uid());
    let text = String::from_utf8_lossy(&foreign.data_set()).into_owned();
    let at = text.find(series.as_str()).unwrap();
    let mut bytes = foreign.data_set();
    bytes[at..at + claimed.as_str().len()].copy_from_slice(claimed.as_str().as_bytes());
    let announced = Announced {
        encoding: Encoding::DataSet(EXPLICIT.parse().unwrap()),
        sop_class_uid: None,
        sop_instance_uid: None,
        study_instance_uid: None,
        sender: Sender::Upload { id: Uuid::new_v4() },
    };
    let error = entrance.give(&bytes, announced).await.unwrap_err();
    assert!(matches!(error, Error::ConflictingStudy(_)), "{error:?}");
    assert_eq!(blobs(dir.path()), 1);
}

#[tokio::test]
async fn one_instance_from_many_senders_at_once_is_stored_once() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let slice = Slice::default();
    let sending = (0..8).map(|_| entrance.send(Uuid::new_v4(), &slice));
    let receipts = futures_util::future::join_all(sending).await;
    let stored = receipts.iter().filter(|receipt| !receipt.as_ref().unwrap().duplicate).count();
    assert_eq!(stored, 1);
    assert_eq!(entrance.series(1).await.instances, 1);
    assert_eq!(blobs(dir.path()), 1);
}

#[tokio::test]
async fn what_is_not_as_announced_is_refused() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    let announced = Announced {
        encoding: Encoding::DataSet(EXPLICIT.parse().unwrap()),
        sop_class_uid: None,
        sop_instance_uid: Some(Slice::of(1, 2).sop_uid()),
        study_instance_uid: None,
        sender: Sender::Upload { id: Uuid::new_v4() },
    };
    let error = entrance.give(&Slice::of(1, 1).data_set(), announced).await.unwrap_err();
    assert!(matches!(error, Error::DataSetMismatch(_)), "{error:?}");

    let mr = Slice { sop_class: "1.2.840.10008.5.1.4.1.1.4", modality: "MR", ..Slice::default() };
    let error = entrance.upload(Uuid::new_v4(), &mr.part10()).await.unwrap_err();
    assert!(matches!(error, Error::UnsupportedSopClass(_)), "{error:?}");

    let error = entrance.upload(Uuid::new_v4(), b"readme").await.unwrap_err();
    assert!(matches!(error, Error::NotDicom(_)), "{error:?}");
    assert_eq!(blobs(dir.path()) + unfinished(dir.path()), 0);
}

#[tokio::test]
async fn limits_are_told_before_anything_is_kept() {
    let dir = tempdir().unwrap();
    let mut config = settings(dir.path());
    config.intake.max_instance_bytes = 2_000;
    config.intake.max_series_instances = 2;
    let entrance = Entrance::open(config).await;
    let large = Slice { edge: 64, ..Slice::default() };
    let error = entrance.send(Uuid::new_v4(), &large).await.unwrap_err();
    assert!(
        matches!(error, Error::TooLarge { limit_bytes: 2_000, setting: "intake.max_instance_bytes" }),
        "{error:?}"
    );
    entrance.send_all(Uuid::new_v4(), 1, 1..3).await;
    let error = entrance.send(Uuid::new_v4(), &Slice::of(1, 3)).await.unwrap_err();
    assert!(matches!(error, Error::SeriesFull { limit: 2, .. }), "{error:?}");
    assert_eq!(blobs(dir.path()), 2);

    entrance.intake.shut();
    assert!(matches!(entrance.intake.begin().await, Err(Error::ShuttingDown)));
}

#[tokio::test]
async fn a_nearly_full_disk_refuses_before_the_first_byte() {
    let dir = tempdir().unwrap();
    let mut config = settings(dir.path());
    config.storage.min_free_bytes = u64::MAX;
    let entrance = Entrance::open(config).await;
    assert!(matches!(entrance.intake.begin().await, Err(Error::OutOfStorage)));
    assert!(entrance.store.ready().await.data_dir.is_err());
    assert!(entrance.store.free_bytes().unwrap() > 0);
}

#[tokio::test]
async fn refusals_name_no_patient() {
    let dir = tempdir().unwrap();
    let entrance = Entrance::open(settings(dir.path())).await;
    entrance.send(Uuid::new_v4(), &Slice::default()).await.unwrap();
    let mr = Slice { sop_class: "1.2.840.10008.5.1.4.1.1.4", number: 5, ..Slice::default() };
    for slice in [Slice { value: 1, ..Slice::default() }, Slice::of(2, 1), mr] {
        let error = format!("{:?}", entrance.send(Uuid::new_v4(), &slice).await.unwrap_err());
        assert!(!error.contains("4711") && !error.contains("Sauerbruch"), "{error}");
    }
}
