//! A data directory that release 0.1 made opens with every later version: by a reconstruction's id its
//! clouds and reports are what 0.1 gave.
//!
//! Different by design: the JSON of series and reconstructions has more fields; the cloud and report
//! of a series have other ETags and are those of the clinical reconstruction (0.1: of the one made last); `format=ply`, once
//! refused, may be served; slices' pictures are drawn again, and say so.

use std::path::Path;

use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};

use crate::support::client::Client;
use crate::support::data;
use crate::support::service::{Service, Settings, run, triplanar};

fn unpacked(shared: &Path) -> (tempfile::TempDir, Vec<Value>) {
    let dir = tempfile::tempdir().unwrap();
    let archive = std::fs::File::open(shared.join("data_dir_0.1.tgz")).expect("the data directory of 0.1");
    tar::Archive::new(flate2::read::GzDecoder::new(archive)).unpack(dir.path()).unwrap();
    let answers = std::fs::read(dir.path().join("answers.json")).unwrap();
    (dir, serde_json::from_slice(&answers).unwrap())
}

fn sha256(bytes: &[u8]) -> String {
    hex::encode(Sha256::digest(bytes))
}

#[tokio::test(flavor = "multi_thread")]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
async fn every_answer_of_0_1_is_given_again() {
    let shared = data::dir();
    let (dir, answers) = unpacked(&shared);
    assert_eq!(answers.len(), 116);
    let service = Settings::new().start_on(dir);
    let mut same = 0;
    for answer in &answers {
        let path = answer["path"].as_str().unwrap();
        let mut request = Client::new(service.http).request(reqwest::Method::GET, path);
        for (name, value) in answer["headers"].as_object().unwrap() {
            request = request.header(name, value.as_str().unwrap());
        }
        let response = request.send().await.unwrap();
        let status = response.status().as_u16();
        if path.ends_with("format=ply") {
            assert!(status == 400 || status == 200, "{path}: {status}");
            continue;
        }
        assert_eq!(json!(status), answer["status"], "{path}");
        let header = |name| response.headers().get(name).map(|value| value.to_str().unwrap().to_owned());
        assert_eq!(json!(header("content-type")), answer["type"], "{path}");
        if path.ends_with(".png") {
            assert_eq!(header("triplanar-picture").as_deref(), Some("drawn-again"), "{path}");
        }
        let body = response.bytes().await.unwrap();
        let by_id = path.starts_with("/v1/reconstructions/");
        if by_id && (path.contains("/cloud") || path.ends_with("/report")) {
            assert_eq!(json!(sha256(&body)), answer["sha256"], "{path}");
            same += 1;
        }
    }
    assert_eq!(same, 9 * 5 + 13 * 2, "clouds in five ways, reports in two");
    series_give_their_own(&service).await;
    asked_again(&service).await;
}

/// Of each series that which 0.1 queued itself, with the default parameters, not what was tried later.
async fn series_give_their_own(service: &Service) {
    let client = Client::new(service.http);
    let page = client.json("/v1/series").await;
    let series = page["items"].as_array().unwrap();
    assert_eq!(series.len(), 4);
    for series in series {
        let uid = series["series_instance_uid"].as_str().unwrap();
        let first = client.reconstructions(uid).await.remove(0);
        assert_eq!(
            (&first["parameters"]["profile"], &first["parameters"]["leaf_mm"]),
            (&json!("precise"), &json!(1.0))
        );
        let response = client.get(&format!("/v1/series/{uid}/cloud")).await;
        assert_eq!(response.headers()["triplanar-reconstruction"].to_str().unwrap(), first["id"]);
        let by_id = format!("/v1/reconstructions/{}/cloud", first["id"].as_str().unwrap());
        assert_eq!(response.bytes().await.unwrap(), client.bytes(&by_id).await);
    }
}

/// What 0.1 made is found by its instances and parameters, where the algorithm is still the same; `precise` is
/// another by now, and asking again makes a result of it beside the former one.
async fn asked_again(service: &Service) {
    let client = Client::new(service.http);
    let before = client.json("/v1/reconstructions").await;
    let rows = before["items"].as_array().unwrap();
    assert_eq!(rows.len(), 13);
    let mut made = 0;
    for row in rows.iter().filter(|row| row["state"] == "succeeded") {
        let path = format!("/v1/series/{}/reconstructions", row["series_instance_uid"].as_str().unwrap());
        let mut wanted = row["parameters"].clone();
        if wanted["profile"] == "paper" {
            wanted.as_object_mut().unwrap().remove("quality");
        }
        let (status, told) = client.post(&path, &wanted).await;
        assert_eq!(status.as_u16(), 202, "{told:#}");
        if wanted["profile"] == "paper" {
            assert_eq!((&told["id"], &told["algorithm"]), (&row["id"], &json!("paper/1")));
            assert_eq!(told["state"], "succeeded");
        } else {
            assert_eq!((&row["algorithm"], &told["algorithm"]), (&json!("precise/1"), &json!("precise/2")));
            assert_ne!(told["id"], row["id"]);
            made += 1;
        }
    }
    let rows = client.json("/v1/reconstructions").await;
    assert_eq!(rows["items"].as_array().unwrap().len(), 13 + made);
}

/// `triplanar COMMAND --json` on a data directory, which must end well.
fn told(command: &str, data: &Path) -> Value {
    let mut program = triplanar();
    program.args([command, "--json", "--data-dir"]).arg(data);
    let output = run(program);
    assert!(output.status.success(), "{command}: {output:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
async fn it_is_checked_as_it_is_and_gives_the_same_after_its_catalog_was_lost() {
    let (dir, answers) = unpacked(&data::dir());
    let data = dir.path().join("data");
    let catalog = std::fs::read(data.join("catalog.sqlite")).unwrap();
    let checked = told("check", &data);
    assert_eq!((&checked["problems"], &checked["results"]), (&json!([]), &json!(13)), "{checked:#}");
    assert_eq!(std::fs::read(data.join("catalog.sqlite")).unwrap(), catalog, "it is only read");

    std::fs::remove_file(data.join("catalog.sqlite")).unwrap();
    let rebuilt = told("rebuild", &data);
    assert_eq!((&rebuilt["series"], &rebuilt["set_aside"]), (&json!(4), &json!([])), "{rebuilt:#}");
    assert_eq!(told("check", &data)["problems"], json!([]));
    let service = Settings::new().with("intake.quiet", "0.2").start_on(dir);
    let client = Client::new(service.http);
    for answer in &answers {
        let path = answer["path"].as_str().unwrap();
        if path.starts_with("/v1/reconstructions/") && path.ends_with("/cloud") && answer["status"] == 200 {
            let mut request = client.request(reqwest::Method::GET, path);
            for (name, value) in answer["headers"].as_object().unwrap() {
                request = request.header(name, value.as_str().unwrap());
            }
            let body = request.send().await.unwrap().bytes().await.unwrap();
            assert_eq!(json!(sha256(&body)), answer["sha256"], "{path}");
        }
    }
    series_give_their_own(&service).await;
    for series in client.json("/v1/series").await["items"].as_array().unwrap() {
        assert_eq!(series["doubts"], json!([]), "all that is stored was in a result: {series:#}");
    }
}
