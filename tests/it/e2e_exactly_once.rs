//! A complete series becomes exactly one reconstruction per set of instances and parameters.

use reqwest::{Method, StatusCode};
use serde_json::json;

use crate::support::client::{Client, answer};
use crate::support::service::Service;
use crate::support::{pacs, phantom};

/// The same instance with one pixel changed.
fn with_other_pixels(file: &[u8]) -> Vec<u8> {
    let mut other = file.to_vec();
    let low_byte_of_last_pixel = other.len() - 2;
    other[low_byte_of_last_pixel] ^= 1;
    other
}

async fn reconstructed(service: &Service) -> serde_json::Value {
    pacs::push(service, &phantom::small().files).await;
    let rows = Client::new(service.http).settled(&phantom::small().uid, 1).await;
    assert_eq!(rows[0]["state"], "succeeded", "{rows:#?}");
    rows[0].clone()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_duplicate_is_a_success_and_makes_no_second_job() {
    let service = phantom::settings().start();
    let client = Client::new(service.http);
    let series = phantom::small();
    let first = reconstructed(&service).await;
    pacs::push(&service, &series.files).await;
    for file in &series.files[..2] {
        let (status, body) = client.upload("application/dicom", file.clone()).await;
        assert!(status.is_success(), "{status}: {body}");
    }
    let path = format!("/v1/series/{}", series.uid);
    let (status, _) = client.post(&format!("{path}/complete"), &json!({})).await;
    assert!(status.is_success(), "{status}");
    // Longer than both quiet times that could fire.
    tokio::time::sleep(std::time::Duration::from_millis(1_500)).await;
    let rows = client.reconstructions(&series.uid).await;
    assert_eq!(rows.len(), 1, "a duplicate made a job: {rows:#?}");
    assert_eq!(rows[0]["id"], first["id"]);
    assert_eq!(rows[0]["attempts"], 1);
    assert_eq!(client.json(&path).await["instances"], phantom::SLICES);
}

#[tokio::test(flavor = "multi_thread")]
async fn other_pixels_under_a_known_uid_are_refused_and_the_report_says_so() {
    let service = phantom::settings().with("intake.quiet_after_association", "1").start();
    let client = Client::new(service.http);
    let series = phantom::small();
    let other = with_other_pixels(&series.files[3]);
    pacs::push(&service, &series.files[..6]).await;
    assert_eq!(pacs::statuses(&service, std::slice::from_ref(&other)).await, [0xC003]);
    let (status, body) = client.upload("application/dicom", other).await;
    assert_eq!(
        (status, &body["type"]),
        (StatusCode::CONFLICT, &json!("urn:triplanar:problem:conflicting-instance"))
    );
    pacs::push(&service, &series.files[6..]).await;

    let rows = client.settled(&series.uid, 1).await;
    assert_eq!(rows[0]["state"], "succeeded", "{rows:#?}");
    let report = client.json(&format!("/v1/series/{}/report", series.uid)).await;
    let refused = report["refused"].as_array().expect("refused instances");
    assert_eq!(refused.len(), 1, "{refused:?}");
    assert_eq!((&refused[0]["code"], &refused[0]["times"]), (&json!("conflicting-instance"), &json!(2)));

    // One that comes after the end is told as well.
    let late = with_other_pixels(&series.files[7]);
    assert_eq!(pacs::statuses(&service, &[late]).await, [0xC003]);
    let report = client.json(&format!("/v1/series/{}/report", series.uid)).await;
    assert_eq!(report["refused"].as_array().map(Vec::len), Some(2), "{}", report["refused"]);
    assert_eq!(client.reconstructions(&series.uid).await.len(), 1, "a refused instance made a job");

    let untouched = phantom::settings().start();
    reconstructed(&untouched).await;
    let path = format!("/v1/series/{}/cloud", series.uid);
    let (one, other) = (client.bytes(&path).await, Client::new(untouched.http).bytes(&path).await);
    assert!(one == other, "the stored instance was touched by the refused one");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_late_slice_makes_a_new_revision_and_the_old_one_is_still_served() {
    let service = phantom::settings().start();
    let client = Client::new(service.http);
    let series = phantom::small();
    let (last, others) = series.files.split_last().expect("slices");
    pacs::push(&service, others).await;
    let first = client.settled(&series.uid, 1).await.remove(0);
    assert_eq!((&first["state"], &first["revision"]), (&json!("succeeded"), &json!(1)), "{first:#?}");
    let old = client.bytes(&format!("/v1/reconstructions/{}/cloud", first["id"].as_str().unwrap())).await;

    pacs::push(&service, std::slice::from_ref(last)).await;
    let rows = client.settled(&series.uid, 2).await;
    assert_eq!(rows.len(), 2, "{rows:#?}");
    assert_eq!(rows[0]["state"], "superseded", "{rows:#?}");
    assert_eq!(rows[0]["superseded_by"], rows[1]["id"]);
    assert_eq!((&rows[1]["state"], &rows[1]["revision"]), (&json!("succeeded"), &json!(2)), "{rows:#?}");
    assert_eq!(rows[1]["instances"], phantom::SLICES);
    let still = client.bytes(&format!("/v1/reconstructions/{}/cloud", first["id"].as_str().unwrap())).await;
    assert!(still == old, "the superseded cloud has changed");
    let newest = client.bytes(&format!("/v1/series/{}/cloud", series.uid)).await;
    assert!(newest != old, "the series still serves the old revision");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_parameters_are_the_same_reconstruction_and_others_another() {
    let service = phantom::settings().start();
    let client = Client::new(service.http);
    let first = reconstructed(&service).await;
    let path = format!("/v1/series/{}/reconstructions", phantom::small().uid);
    let (_, same) = client.post(&path, &json!({})).await;
    assert_eq!(same["id"], first["id"], "the configured parameters again are the same reconstruction");

    // Asked for eight times at once.
    let body = json!({"leaf_mm": 2.0, "radius_outlier": {"min_neighbours": 0}});
    let asked = (0..8).map(|_| client.post(&path, &body));
    let answers = futures_util::future::join_all(asked).await;
    for (status, answer) in &answers {
        assert!(status.is_success(), "{status}: {answer}");
        assert_eq!(answer["id"], answers[0].1["id"], "one request made another reconstruction");
    }
    assert_eq!(client.settled(&phantom::small().uid, 2).await.len(), 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cancelled_reconstruction_ends_and_its_events_end_with_it() {
    // The worker is busy with the first; the second waits and can be cancelled for certain.
    let service = phantom::settings().start();
    let client = Client::new(service.http);
    reconstructed(&service).await;
    let path = format!("/v1/series/{}/reconstructions", phantom::small().uid);
    let mut ids = Vec::new();
    for leaf in [0.05, 0.06, 0.07] {
        let (status, made) = client.post(&path, &json!({"leaf_mm": leaf})).await;
        assert_eq!(status, StatusCode::ACCEPTED, "{made}");
        ids.push(made["id"].as_str().expect("an id").to_owned());
    }
    let events = client.get(&format!("/v1/reconstructions/{}/events", ids[2])).await;
    let cancel = client.request(Method::DELETE, &format!("/v1/reconstructions/{}", ids[2]));
    let (status, body) = answer(cancel).await;
    assert!(status.is_success(), "{status}: {body}");
    let told = tokio::time::timeout(std::time::Duration::from_secs(60), events.text()).await;
    let told = told.expect("the events end").expect("a body");
    assert!(told.contains("cancelled"), "{told}");
    let rows = client.settled(&phantom::small().uid, 3).await;
    let cancelled = rows.iter().find(|row| row["id"] == ids[2].as_str());
    assert_eq!(cancelled.map(|row| &row["state"]), Some(&json!("cancelled")), "{rows:#?}");
}
