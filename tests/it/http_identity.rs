//! While the identity of a series is being corrected nothing is served that shows a patient.

use serde_json::Value;

use crate::support::http::{SLICES, Server, problem, slices, zipped};
use crate::support::slice::Slice;

/// Those slices with another Patient ID.
fn corrected(which: std::ops::Range<usize>) -> Vec<u8> {
    let files: Vec<(String, Vec<u8>)> = slices(1, SLICES)
        .drain(which)
        .map(|slice| (slice.number.to_string(), Slice { patient_id: "PATIENT-0815", ..slice }.part10()))
        .collect();
    let files: Vec<(&str, &[u8])> = files.iter().map(|(name, file)| (name.as_str(), &file[..])).collect();
    zipped(&files)
}

async fn series(server: &Server, path: &str) -> Value {
    server.get(path).send().await.unwrap().json().await.unwrap()
}

#[tokio::test]
async fn a_series_whose_identity_is_changing_serves_no_cloud() {
    let server = Server::start().await;
    let (uid, id) = server.succeeded(1).await;
    let path = format!("/v1/series/{uid}");
    assert_eq!(series(&server, &path).await["identity_changing"], false);

    server.upload("", corrected(0..4)).await;
    let told = series(&server, &path).await;
    assert_eq!(
        (&told["identity_changing"], &told["history"]),
        (&Value::from(true), &Value::Array(Vec::new()))
    );
    let results = [
        format!("{path}/cloud"),
        format!("{path}/report"),
        format!("/v1/reconstructions/{id}/cloud"),
        format!("/v1/reconstructions/{id}/report"),
        format!("/v1/reconstructions/{id}/slices/axial/0.png"),
    ];
    for result in &results {
        problem(server.get(result).send().await.unwrap(), 409, "identity-changing").await;
    }

    server.upload("", corrected(4..10)).await;
    let told = series(&server, &path).await;
    assert_eq!(told["identity_changing"], false);
    assert_eq!(told["patient_id"], "PATIENT-0815");
    assert_eq!(told["history"][0]["event"], "identity_changed");
    assert_eq!(told["history"][0]["fields"], serde_json::json!(["patient_id"]));
    assert!(!told["history"].to_string().contains("4711"));
    for result in &results[..4] {
        assert_eq!(server.get(result).send().await.unwrap().status(), 200, "{result}");
    }
    let found = series(&server, "/v1/series?PatientID=PATIENT-0815").await;
    assert_eq!(found["items"].as_array().unwrap().len(), 1);
    assert_eq!(series(&server, "/v1/series?PatientID=PATIENT-4711").await["items"], serde_json::json!([]));
}

#[tokio::test]
async fn other_attributes_are_told_in_the_history_without_what_they_say() {
    let server = Server::start().await;
    let (uid, id) = server.succeeded(1).await;
    let files: Vec<(String, Vec<u8>)> = slices(1, SLICES)
        .into_iter()
        .map(|slice| (slice.number.to_string(), Slice { comments: "ZQ-COMMENT", ..slice }.part10()))
        .collect();
    let files: Vec<(&str, &[u8])> = files.iter().map(|(name, file)| (name.as_str(), &file[..])).collect();
    server.upload("", zipped(&files)).await;
    let told = series(&server, &format!("/v1/series/{uid}")).await;
    assert_eq!((&told["identity_changing"], &told["revision"]), (&Value::from(false), &Value::from(1)));
    assert_eq!(told["history"][0]["event"], "attributes_changed");
    assert_eq!(told["history"][0]["instances"], SLICES);
    assert!(!told.to_string().contains("ZQ-COMMENT"));
    let cloud = server.get(&format!("/v1/reconstructions/{id}/cloud")).send().await.unwrap();
    assert_eq!(cloud.status(), 200);
}
