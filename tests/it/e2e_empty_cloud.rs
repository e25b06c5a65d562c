//! Nothing is silent: a series from which nothing can be made has failed, with its full report.

use serde_json::json;

use crate::support::client::Client;
use crate::support::service::Settings;
use crate::support::{data, pacs};

/// Slices of the GE series as the published program cuts it: axial, sagittal, coronal
/// (`published_program/ge_hispeed_tilt_variable/slices.jsonl`).
fn published_slices(data: &std::path::Path) -> usize {
    let path = data.join("published_program/ge_hispeed_tilt_variable/slices.jsonl");
    std::fs::read_to_string(path).expect("the published results").lines().count()
}

#[tokio::test(flavor = "multi_thread")]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
async fn a_series_that_gives_nothing_fails_as_empty_cloud_with_its_report_served() {
    let data = data::dir();
    let files: Vec<_> =
        data::series(&data, "ge_hispeed_tilt_variable", "").into_iter().map(|(_, bytes)| bytes).collect();
    let service = Settings::new().with("pipeline.profile", "paper").start();
    let client = Client::new(service.http);
    pacs::push(&service, &files).await;
    let page = client.json("/v1/series").await;
    let series = page["items"][0]["series_instance_uid"].as_str().expect("one series").to_owned();
    let rows = client.settled(&series, 1).await;
    assert_eq!(rows.len(), 1, "{rows:#?}");
    assert_eq!((&rows[0]["state"], &rows[0]["error"]["code"]), (&json!("failed"), &json!("empty_cloud")));
    assert_eq!(rows[0]["attempts"], 1, "what lies in the data is not tried again");

    let id = rows[0]["id"].as_str().expect("an id");
    let report = client.json(&format!("/v1/reconstructions/{id}/report")).await;
    let slices = report["slices"].as_array().expect("a row for each slice");
    assert_eq!(slices.len(), published_slices(&data), "a row is missing");
    assert!(slices.iter().all(|row| row["accepted"] == true || row["reason"].is_string()));
    assert_eq!(report["error"]["code"], "empty_cloud");

    // Who asks by the series is told where it is.
    let of_series = client.get(&format!("/v1/series/{series}/report")).await;
    assert_eq!(of_series.status(), 409);
    let problem: serde_json::Value = of_series.json().await.expect("a problem");
    let detail = problem["detail"].as_str().expect("a detail");
    assert!(detail.contains(&format!("/v1/reconstructions/{id}/report")), "{detail}");
}
