//! Files of the data directory that are gone or changed: a job, a duplicate and `triplanar check`
//! notice.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use reqwest::StatusCode;
use serde_json::{Value, json};

use crate::support::client::Client;
use crate::support::service::{Service, run, triplanar};
use crate::support::{pacs, phantom};

/// `triplanar check --json` of a data directory: exit code and answer.
fn check(data_dir: &Path) -> (Option<i32>, Value) {
    let mut command = triplanar();
    command.args(["check", "--json", "--data-dir"]).arg(data_dir);
    let Output { status, stdout, stderr } = run(command);
    let answer = serde_json::from_slice(&stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&stderr)));
    (status.code(), answer)
}

fn kinds(answer: &Value) -> Vec<&str> {
    let problems = answer["problems"].as_array().expect("problems");
    problems.iter().map(|problem| problem["kind"].as_str().expect("a kind")).collect()
}

/// The file of the instance at `index`, and its SOP Instance UID, by the name that it has.
fn stored(service: &Service, index: usize) -> (PathBuf, String) {
    let mut files = Vec::new();
    for shard in fs::read_dir(service.data_dir().join("instances")).expect("instances") {
        for file in fs::read_dir(shard.expect("a shard").path()).expect("files") {
            files.push(file.expect("a file").path());
        }
    }
    files.sort_by_key(|path| path.file_name().expect("a name").to_owned());
    let name = files[index].file_name().expect("a name").to_string_lossy().into_owned();
    let uid = name.trim_end_matches(".dcm").rsplit_once('.').expect("UID and unique part").0.to_owned();
    (files[index].clone(), uid)
}

/// Asks for a reconstruction that was not made before, and waits for its end.
async fn reconstruct(client: &Client, unique_distance_mm: f64, count: usize) -> Value {
    let uid = &phantom::small().uid;
    let path = format!("/v1/series/{uid}/reconstructions");
    let (status, asked) = client.post(&path, &json!({ "unique_distance_mm": unique_distance_mm })).await;
    assert!(status.is_success(), "{status} {asked}");
    client.settled(uid, count).await;
    client.json(&format!("/v1/reconstructions/{}", asked["id"].as_str().expect("an id"))).await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_changed_or_missing_instance_fails_by_name_and_a_duplicate_heals_it() {
    let service = phantom::settings().start();
    let series = phantom::small();
    let client = Client::new(service.http);
    pacs::push(&service, &series.files).await;
    let rows = client.settled(&series.uid, 1).await;
    assert_eq!(rows[0]["state"], "succeeded", "{rows:#?}");
    let good = client.bytes(&format!("/v1/series/{}/cloud", series.uid)).await;
    let (code, answer) = check(&service.data_dir());
    assert_eq!(
        (code, answer["in_use"].as_bool(), kinds(&answer)),
        (Some(0), Some(true), vec![]),
        "{answer:#}"
    );
    assert_eq!((&answer["instances"], &answer["results"]), (&json!(phantom::SLICES), &json!(1)));

    // Bits in the pixels, and a whole file.
    let (flipped, flipped_uid) = stored(&service, 3);
    let mut bytes = fs::read(&flipped).expect("the file");
    let pixel = bytes.len() - 100_000;
    bytes[pixel] ^= 0x08;
    fs::write(&flipped, &bytes).expect("it can be changed");
    let (missing, missing_uid) = stored(&service, 7);
    fs::remove_file(&missing).expect("it can be removed");
    let failed = reconstruct(&client, 1.25, 2).await;
    assert_eq!(
        (&failed["state"], &failed["error"]["code"]),
        (&json!("failed"), &json!("blob_damaged")),
        "{failed:#}"
    );
    assert_eq!(failed["attempts"], 1, "{failed:#}");
    let mut named = vec![flipped_uid, missing_uid];
    named.sort();
    let sorted = failed["error"]["instances"].as_array().map(|uids| {
        let mut uids: Vec<_> = uids.iter().map(|uid| uid.as_str().expect("a UID").to_owned()).collect();
        uids.sort();
        uids
    });
    assert_eq!(sorted, Some(named), "{failed:#}");
    let (code, answer) = check(&service.data_dir());
    let mut found = kinds(&answer);
    found.sort_unstable();
    assert_eq!((code, found), (Some(6), vec!["damaged", "missing"]), "{answer:#}");

    pacs::push(&service, &series.files).await;
    let (code, answer) = check(&service.data_dir());
    assert_eq!((code, kinds(&answer)), (Some(0), vec![]), "{answer:#}");
    let metrics = client.get("/metrics").await.text().await.expect("metrics");
    assert!(metrics.contains("triplanar_replaced_blobs 2"), "{metrics}");
    let again = reconstruct(&client, 1.25, 2).await;
    assert_eq!((&again["state"], &again["id"]), (&json!("succeeded"), &failed["id"]), "{again:#}");
    assert_eq!(
        client.bytes(&format!("/v1/reconstructions/{}/cloud", rows[0]["id"].as_str().expect("id"))).await,
        good
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn check_finds_a_broken_result_and_a_broken_catalog() {
    let service = phantom::settings().start();
    let series = phantom::small();
    pacs::push(&service, &series.files).await;
    let client = Client::new(service.http);
    let id = client.settled(&series.uid, 1).await[0]["id"].as_str().expect("an id").to_owned();
    let (status, dir) = service.terminate();
    assert!(status.success());
    let data = dir.path().join("data");
    let result =
        fs::read_dir(data.join("results").join(&id)).expect("fences").next().expect("one").expect("it");
    let cloud = result.path().join("triplanar.ply");
    let whole = fs::read(&cloud).expect("the cloud");
    fs::write(&cloud, &whole[..whole.len() / 2]).expect("it can be cut");
    fs::remove_file(result.path().join("report.json")).expect("it can be removed");
    fs::write(data.join("instances/00/stranger.dcm"), b"x").expect("a file without a row");
    let (code, answer) = check(&data);
    let mut found = kinds(&answer);
    found.sort_unstable();
    assert_eq!((code, found), (Some(6), vec!["damaged", "missing", "no_row"]), "{answer:#}");
    assert_eq!(answer["in_use"], json!(false));
    assert!(
        answer["problems"].as_array().expect("problems").iter().any(|p| p["of"] == json!(id)),
        "{answer:#}"
    );

    let mut bytes = fs::read(data.join("catalog.sqlite")).expect("the catalog");
    bytes[..100].fill(0x55);
    fs::write(data.join("catalog.sqlite"), bytes).expect("it can be broken");
    let mut command = triplanar();
    command.args(["check", "--data-dir"]).arg(&data);
    let output = run(command);
    assert_eq!(output.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&output.stderr).contains("triplanar rebuild"), "{output:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_picture_of_damaged_instances_is_an_error_that_says_so() {
    let service = phantom::settings().with("http.cached_volumes", "0").start();
    let series = phantom::small();
    pacs::push(&service, &series.files).await;
    let client = Client::new(service.http);
    let id = client.settled(&series.uid, 1).await[0]["id"].as_str().expect("an id").to_owned();
    let (path, _) = stored(&service, 2);
    fs::remove_file(path).expect("it can be removed");
    let answer = client.get(&format!("/v1/reconstructions/{id}/slices/axial/5.png")).await;
    // Pictures that are stored with the result need no instances.
    if answer.status() != StatusCode::OK {
        assert_eq!(answer.status(), StatusCode::INTERNAL_SERVER_ERROR);
        let body = answer.text().await.expect("a body");
        assert!(body.contains("urn:triplanar:problem:stored-damaged"), "{body}");
    }
}
