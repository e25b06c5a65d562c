//! The profile `precise` through the service.

use serde_json::{Value, json};
use triplanar::phantom::Options;

use crate::support::client::Client;
use crate::support::head::{SHAPE, files, reconstructed, uid};
use crate::support::service::Settings;
use crate::support::vertices::{pcd, ply};
use crate::support::{pacs, phantom};

#[tokio::test(flavor = "multi_thread")]
async fn the_service_gives_the_command_lines_bytes_its_verdict_and_filtered_clouds() {
    let service = Settings::new().with("pipeline.profile", "precise").start();
    pacs::push(&service, &files()).await;
    let client = Client::new(service.http);
    let rows = client.settled(&uid(), 1).await;
    assert_eq!(rows[0]["state"], "succeeded", "{rows:#?}");
    let path = format!("/v1/series/{}", uid());

    let dir = tempfile::tempdir().expect("a folder");
    let report: Value = client.json(&format!("{path}/report")).await;
    for plane in ["triplanar", "axial", "sagittal", "coronal"] {
        let (cloud, told, _) = reconstructed(dir.path(), "a.ply", &["--plane", plane]);
        let served = client.bytes(&format!("{path}/cloud?plane={plane}")).await;
        assert!(served == cloud, "{plane}: other bytes than the command line's");
        assert_eq!(told, report);
    }
    assert_eq!(rows[0]["quality"], report["quality"], "the verdict stands on the reconstruction too");
    let verdict = report["quality"]["verdict"].as_str().expect("a verdict").to_owned();
    let metrics = String::from_utf8(client.bytes("/metrics").await).expect("text");
    let line = format!("triplanar_verdicts_total{{verdict=\"{verdict}\"}} 1");
    assert!(metrics.lines().any(|l| l == line), "{line} is missing");

    // The filter, counted again.
    let (whole, _) = ply(&client.bytes(&format!("{path}/cloud")).await);
    let errors = &whole["expected_error_mm"];
    let limit = 0.1_f32;
    let kept = errors.iter().filter(|error| **error <= f64::from(limit)).count();
    assert!(kept > 0 && kept < errors.len(), "{kept} of {} within {limit} mm", errors.len());
    let filtered = client.get(&format!("{path}/cloud?max_error_mm=0.1&format=pcd&frame=ras")).await;
    let name = filtered.headers()["content-disposition"].to_str().expect("text").to_owned();
    assert!(name.contains("max-error-0.1mm") && name.contains("ras"), "{name}");
    let tag = filtered.headers()["etag"].clone();
    let (columns, comments) = pcd(&filtered.bytes().await.expect("a body"));
    assert_eq!(columns["expected_error_mm"].len(), kept);
    assert!(comments.contains(&"max_error_mm 0.1".to_owned()), "{comments:?}");
    let other = client.get(&format!("{path}/cloud?format=pcd&frame=ras")).await;
    assert_ne!(other.headers()["etag"], tag, "another filter is another representation");
    let axial = client.bytes(&format!("{path}/cloud?max_error_mm=0.1&plane=axial")).await;
    assert!(ply(&axial).0["expected_error_mm"].iter().all(|error| *error <= f64::from(limit)));
    assert_eq!(client.get(&format!("{path}/cloud?max_error_mm=-1")).await.status(), 400);
    for format in ["ply", "ply_ascii", "pcd", "raw", "npy"] {
        let none = client.get(&format!("{path}/cloud?max_error_mm=0.000001&format={format}")).await;
        assert_eq!(none.status(), 422, "{format}: a filter that keeps nothing gives no cloud");
        let problem: Value = none.json().await.expect("a problem");
        assert_eq!(problem["type"], "urn:triplanar:problem:empty-cloud");
        assert!(problem["detail"].as_str().is_some_and(|detail| detail.contains("least")), "{problem}");
    }

    // Pictures: in mm proportion, the accepted border green where the report has one.
    let id = rows[0]["id"].as_str().expect("an id");
    for (plane, index, rows, columns) in [
        ("axial", 30, SHAPE[1], SHAPE[2]),
        ("sagittal", 128, SHAPE[0] * 20 / 9, SHAPE[1]),
        ("coronal", 125, SHAPE[0] * 20 / 9, SHAPE[2]),
    ] {
        let png = client.bytes(&format!("/v1/reconstructions/{id}/slices/{plane}/{index}.png")).await;
        let picture = image::load_from_memory(&png).expect("a PNG").to_rgb8();
        assert_eq!(picture.dimensions(), (columns as u32, rows as u32), "{plane}");
        let green = picture.pixels().filter(|pixel| pixel.0 == [0, 255, 0]).count();
        assert!(green > 300, "{plane}: {green} green pixels");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_neck_without_its_head_fails_as_no_head_with_its_report_served() {
    let neck = phantom::series(Options {
        columns: 256,
        rows: 256,
        column_mm: 0.9,
        row_mm: 0.9,
        slices: 40,
        slice_mm: 2.0,
        top_mm: -85.0,
        ..Options::default()
    });
    let service = Settings::new().start();
    pacs::push(&service, &neck.files).await;
    let client = Client::new(service.http);
    client.settled(&neck.uid, 1).await;
    let (status, asked) = client
        .post(&format!("/v1/series/{}/reconstructions", neck.uid), &json!({ "profile": "precise" }))
        .await;
    assert_eq!(status, 202, "{asked}");
    let id = asked["id"].as_str().expect("an id");
    let count = client.reconstructions(&neck.uid).await.len();
    let rows = client.settled(&neck.uid, count).await;
    let row = rows.iter().find(|row| row["id"] == id).expect("it is listed");
    assert_eq!((&row["state"], &row["error"]["code"]), (&json!("failed"), &json!("no_head")), "{row:#}");
    assert_eq!(row["attempts"], 1, "what lies in the data is not tried again");
    let report = client.json(&format!("/v1/reconstructions/{id}/report")).await;
    assert_eq!(report["error"]["code"], "no_head");
    let slices = report["slices"].as_array().expect("rows");
    assert_eq!(slices.len(), 40 + 256 + 256, "a row for every slice");
    assert!(slices.iter().all(|row| row["decision"] == "rejected" && row["reason"] == "no_contour"));
    let cloud = client.get(&format!("/v1/reconstructions/{id}/cloud")).await;
    assert_eq!(cloud.status(), 409);
    let picture = client.get(&format!("/v1/reconstructions/{id}/slices/sagittal/128.png")).await;
    assert_eq!(picture.status(), 200, "its slices can be looked at");
}
