//! What befalls a data directory and its process: nothing that was kept is lost by it.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use serde_json::{Value, json};

use crate::support::client::Client;
use crate::support::service::{Service, run, triplanar};
use crate::support::{pacs, phantom};

fn files(dir: &Path) -> usize {
    let Ok(entries) = fs::read_dir(dir) else { return 0 };
    entries
        .map(|entry| entry.expect("an entry").path())
        .map(|path| if path.is_dir() { files(&path) } else { 1 })
        .sum()
}

fn blobs(data: &Path) -> usize {
    files(&data.join("instances")) + files(&data.join("results"))
}

/// What a client sees of the series: but for what the time of the rebuilding says.
async fn view(service: &Service) -> (Value, Value, Vec<u8>) {
    let client = Client::new(service.http);
    let series = phantom::small();
    let rows = client.settled(&series.uid, 1).await;
    let mut row = client.json(&format!("/v1/series/{}", series.uid)).await;
    assert_eq!(rows.len(), 1, "{rows:#?}");
    let shown = json!({
        "patient": row["patient_id"].take(), "study": row["study_instance_uid"].take(),
        "instances": row["instances"].take(), "revision": row["revision"].take(),
    });
    (shown, rows[0].clone(), client.bytes(&format!("/v1/series/{}/cloud", series.uid)).await)
}

/// A data directory with a series and its reconstruction, and what a client saw of them.
async fn made() -> (tempfile::TempDir, (Value, Value, Vec<u8>)) {
    let service = phantom::settings().start();
    pacs::push(&service, &phantom::small().files).await;
    let seen = view(&service).await;
    let (status, dir) = service.terminate();
    assert!(status.success());
    (dir, seen)
}

fn rebuild(data: &Path) -> Value {
    let mut command = triplanar();
    command.args(["rebuild", "--json", "--data-dir"]).arg(data);
    let output = run(command);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lost_catalog_costs_no_file_and_is_made_again_with_series_and_results() {
    type Harm = fn(&Path);
    let harms: [(&str, Harm); 3] = [
        ("removed", |file| fs::remove_file(file).expect("it goes")),
        ("emptied", |file| fs::write(file, b"").expect("it is emptied")),
        ("garbage", |file| fs::write(file, [0x55; 8192]).expect("it is broken")),
    ];
    for (name, harm) in harms {
        let (dir, seen) = made().await;
        let data = dir.path().join("data");
        let before = blobs(&data);
        assert!(before > phantom::SLICES, "{name}");
        harm(&data.join("catalog.sqlite"));
        for _ in 0..2 {
            let output = phantom::settings().refused(&data);
            let told = String::from_utf8_lossy(&output.stderr);
            assert!(!output.status.success() && told.contains("triplanar rebuild"), "{name}: {told}");
            assert_eq!(blobs(&data), before, "{name}");
        }
        let rebuilt = rebuild(&data);
        assert_eq!(
            (&rebuilt["series"], &rebuilt["instances"], &rebuilt["reconstructions"], &rebuilt["set_aside"]),
            (&json!(1), &json!(phantom::SLICES), &json!(1), &json!([])),
            "{name}: {rebuilt:#}"
        );
        let service = phantom::settings().with("intake.quiet", "0.2").start_on(dir);
        let client = Client::new(service.http);
        let path = format!("/v1/series/{}", phantom::small().uid);
        while client.json(&path).await["state"] != "complete" {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        assert_eq!(view(&service).await, seen, "{name}");
        assert_eq!(blobs(&service.data_dir()), before, "{name}: nothing was made anew");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_catalog_that_lost_its_log_gets_the_rows_of_its_files_back() {
    let service = phantom::settings().start();
    pacs::push(&service, &phantom::small().files).await;
    let seen = view(&service).await;
    let before = blobs(&service.data_dir());
    let dir = service.kill();
    fs::remove_file(dir.path().join("data/catalog.sqlite-wal")).expect("the log goes");
    let _the_index_may_stay = fs::remove_file(dir.path().join("data/catalog.sqlite-shm"));
    let service = phantom::settings().with("intake.quiet", "0.2").start_on(dir);
    assert_eq!(Client::new(service.http).settled(&phantom::small().uid, 1).await.len(), 1);
    let path = format!("/v1/series/{}", phantom::small().uid);
    while Client::new(service.http).json(&path).await["state"] != "complete" {
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert_eq!(view(&service).await, seen);
    assert_eq!(blobs(&service.data_dir()), before);
    assert!(service.log().contains("what could be entered was entered"), "it is told");
}

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn rebuilding_a_catalog_that_is_in_order_needs_a_word() {
    let dir = tempfile::tempdir().expect("a folder");
    let data = data_dir_of_0_1(dir.path());
    let mut command = triplanar();
    command.args(["rebuild", "--data-dir"]).arg(&data);
    let output = run(command);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("--replace"), "{output:?}");
}

/// The data directory that release 0.1 wrote, unpacked.
fn data_dir_of_0_1(dir: &Path) -> std::path::PathBuf {
    let archive = crate::support::data::dir().join("data_dir_0.1.tgz");
    let archive = fs::File::open(archive).expect("the shared data directory");
    tar::Archive::new(flate2::read::GzDecoder::new(archive)).unpack(dir).expect("it unpacks");
    dir.join("data")
}

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn a_catalog_of_0_1_is_made_again_as_far_as_reports_tell() {
    let dir = tempfile::tempdir().expect("a folder");
    let data = data_dir_of_0_1(dir.path());
    let results = fs::read_dir(data.join("results")).expect("results").count();
    fs::remove_file(data.join("catalog.sqlite")).expect("the catalog goes");
    let rebuilt = rebuild(&data);
    assert_eq!(rebuilt["series"], 4, "{rebuilt:#}");
    assert_eq!(rebuilt["reconstructions"], json!(results), "{rebuilt:#}");
    assert_eq!(rebuilt["unsealed_instances"], rebuilt["instances"], "{rebuilt:#}");
    assert_eq!(rebuilt["from_reports"].as_array().map(Vec::len), Some(results), "{rebuilt:#}");
    assert_eq!(rebuilt["set_aside"], json!([]), "{rebuilt:#}");
    assert!(rebuilt["lost"].as_array().is_some_and(|lost| !lost.is_empty()));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_lock_holds_although_its_file_is_deleted() {
    let service = phantom::settings().start();
    fs::remove_file(service.data_dir().join("lock")).expect("the file goes");
    let output = phantom::settings().refused(&service.data_dir());
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && told.contains("in use by another service"), "{told}");
    assert!(Client::new(service.http).get("/readyz").await.status().is_success());
}

#[tokio::test(flavor = "multi_thread")]
async fn the_catalog_is_its_owners_alone_and_a_hangup_stops_nothing() {
    let dir = tempfile::tempdir().expect("a folder");
    let data = dir.path().join("data");
    fs::create_dir(&data).expect("a folder");
    fs::set_permissions(&data, fs::Permissions::from_mode(0o777)).expect("for all");
    // As an earlier version may have left it.
    fs::write(data.join("catalog.sqlite"), b"").expect("a file");
    fs::set_permissions(data.join("catalog.sqlite"), fs::Permissions::from_mode(0o666)).expect("for all");
    let mut service = phantom::settings().start_on(dir);
    for name in ["catalog.sqlite", "catalog.sqlite-wal", "catalog.sqlite-shm"] {
        let mode = fs::metadata(data.join(name)).expect(name).permissions().mode();
        assert_eq!(mode & 0o777, 0o600, "{name}: {mode:o}");
    }
    let sent = Command::new("kill").args(["-HUP", &service.pid().to_string()]).status().expect("kill runs");
    assert!(sent.success());
    while !service.log().contains("SIGHUP") {
        assert!(service.is_alive());
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert!(Client::new(service.http).get("/readyz").await.status().is_success());
}
