//! Data directories that can't be opened, read or written: the cause, the place and the next step are
//! told, and readiness says so.

use std::fs::{self, File};
use std::os::unix::fs::{FileExt as _, MetadataExt as _, PermissionsExt as _, symlink};
use std::path::Path;
use std::time::Duration;

use serde_json::{Value, json};
use sqlx::Connection as _;
use triplanar::phantom::Options;

use crate::support::client::{Client, answer};
use crate::support::service::{Service, Settings};
use crate::support::{pacs, phantom};

/// A data directory with a series and its reconstruction.
async fn made() -> tempfile::TempDir {
    let service = phantom::settings().start();
    pacs::push(&service, &phantom::small().files).await;
    Client::new(service.http).settled(&phantom::small().uid, 1).await;
    let (status, dir) = service.terminate();
    assert!(status.success());
    dir
}

/// Where the first page of a table lies in the catalog, and how long it is.
async fn page(catalog: &Path, table: &str) -> (u64, usize) {
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(catalog).read_only(true);
    let mut connection = sqlx::SqliteConnection::connect_with(&options).await.expect("it opens");
    let number: i64 = sqlx::query_scalar("SELECT rootpage FROM sqlite_master WHERE name = $1")
        .bind(table.to_owned())
        .fetch_one(&mut connection)
        .await
        .expect("a table");
    let size: i64 = sqlx::query_scalar("PRAGMA page_size").fetch_one(&mut connection).await.expect("a size");
    connection.close().await.expect("it closes");
    (((number - 1) * size).cast_unsigned(), usize::try_from(size).expect("a length"))
}

fn clear(catalog: &Path, (offset, length): (u64, usize)) {
    let file = File::options().write(true).open(catalog).expect("it opens");
    file.write_all_at(&vec![0; length], offset).expect("it is written");
}

/// What `/readyz` says once it is 503.
async fn unready(service: &Service) -> String {
    let client = Client::new(service.http);
    for _ in 0..300 {
        let answer = client.get("/readyz").await;
        if answer.status() == 503 {
            return answer.text().await.expect("a text");
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    panic!("/readyz stays {}", client.get("/readyz").await.status())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_catalog_with_a_cleared_page_is_refused_with_the_next_step() {
    let dir = made().await;
    let data = dir.path().join("data");
    let catalog = data.join("catalog.sqlite");
    let whole = fs::read(&catalog).expect("a catalog");
    for table in ["series", "instances", "reconstructions"] {
        clear(&catalog, page(&catalog, table).await);
        let output = phantom::settings().refused(&data);
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "{table}: {told}");
        for word in ["triplanar rebuild", "triplanar check", "catalog.sqlite-wal"] {
            assert!(told.contains(word), "{table}: {told}");
        }
        fs::write(&catalog, &whole).expect("brought back");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_catalog_damaged_under_a_running_service_makes_it_unready() {
    let dir = made().await;
    let catalog = dir.path().join("data/catalog.sqlite");
    let place = page(&catalog, "instances").await;
    let service = phantom::settings().start_on(dir);
    clear(&catalog, place);
    let told = unready(&service).await;
    assert!(told.contains("triplanar rebuild"), "{told}");
    // Nothing is taken that would be lost with it, by whatever door.
    let other = phantom::series(Options { slices: 2, seed: 7, ..Options::default() });
    let statuses = pacs::statuses(&service, &other.files).await;
    assert_eq!(statuses, [0xA700, 0xA700]);
    let client = Client::new(service.http);
    let (status, told) = client.upload("application/dicom", other.files[0].clone()).await;
    assert_eq!(
        (status.as_u16(), &told["type"]),
        (503, &json!("urn:triplanar:problem:catalog-damaged")),
        "{told:#}"
    );
    let form =
        [b"--b\r\nContent-Type: application/dicom\r\n\r\n", &*other.files[0], b"\r\n--b--\r\n"].concat();
    let stow = client.request(reqwest::Method::POST, "/dicom-web/studies");
    let kind = "multipart/related; type=\"application/dicom\"; boundary=b";
    let (status, told) = answer(stow.header("content-type", kind).body(form)).await;
    assert_eq!(status.as_u16(), 503, "{told:#}");
}

/// The service without the right to read and write whatever it likes, which root has (CAP_DAC_OVERRIDE).
fn without_override() -> Settings {
    let root = fs::metadata("/proc/self").expect("procfs").uid() == 0;
    if root { phantom::settings().without_override() } else { phantom::settings() }
}

/// Asks for a reconstruction with these parameters and gives its path.
async fn asked(client: &Client, unique_distance_mm: f64) -> String {
    let path = format!("/v1/series/{}/reconstructions", phantom::small().uid);
    let (status, told) = client.post(&path, &json!({ "unique_distance_mm": unique_distance_mm })).await;
    assert!(status.is_success(), "{told:#}");
    format!("/v1/reconstructions/{}", told["id"].as_str().expect("an id"))
}

/// Until the reconstruction is like that.
async fn until(client: &Client, path: &str, what: impl Fn(&Value) -> bool) -> Value {
    for _ in 0..1200 {
        let told = client.json(path).await;
        if what(&told) {
            return told;
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    panic!("{path}: {:#}", client.json(path).await)
}

/// It waits for the rights, tells so, and no attempt is lost; once they are given it succeeds.
async fn waits_for_rights(service: &Service, path: &Path, mode: u32, unique_distance_mm: f64) {
    let client = Client::new(service.http);
    let kept = fs::metadata(path).expect("it is there").permissions();
    fs::set_permissions(path, fs::Permissions::from_mode(mode)).expect("rights are taken");
    let reconstruction = asked(&client, unique_distance_mm).await;
    let told = until(&client, &reconstruction, |told| told["error"].is_object()).await;
    assert_eq!(told["error"]["code"], "not_permitted", "{told:#}");
    assert!(
        told["error"]["detail"].as_str().is_some_and(|detail| detail.contains("storage.data_dir")),
        "{told:#}"
    );
    assert_ne!(told["state"], "failed", "{told:#}");
    fs::set_permissions(path, kept).expect("rights are given");
    let told = until(&client, &reconstruction, |told| told["state"] == "succeeded").await;
    assert_eq!((&told["attempts"], &told["error"]), (&json!(1), &Value::Null), "{told:#}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_instance_that_may_not_be_read_and_results_that_may_not_be_written_are_waited_for() {
    let service = without_override().start();
    pacs::push(&service, &phantom::small().files).await;
    let client = Client::new(service.http);
    client.settled(&phantom::small().uid, 1).await;
    let mut shards = fs::read_dir(service.data_dir().join("instances")).expect("instances");
    let blob = shards.find_map(|shard| fs::read_dir(shard.expect("a shard").path()).expect("files").next());
    waits_for_rights(&service, &blob.expect("a file").expect("an entry").path(), 0o000, 1.25).await;
    let results = service.data_dir().join("results");
    let writable = fs::metadata(&results).expect("it is there").permissions();
    fs::set_permissions(&results, fs::Permissions::from_mode(0o555)).expect("rights are taken");
    assert!(unready(&service).await.contains("results"));
    fs::set_permissions(&results, writable).expect("rights are given");
    waits_for_rights(&service, &results, 0o555, 1.5).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn each_folder_that_is_written_is_tried_and_named() {
    for folder in ["results", "incoming", "instances"] {
        let service = phantom::settings().start();
        let path = service.data_dir().join(folder);
        // No folder any more: rights would not keep a test that runs as root from writing.
        fs::rename(&path, service.data_dir().join("away")).expect("it is moved");
        fs::write(&path, b"").expect("a file");
        let told = unready(&service).await;
        assert!(told.contains(folder), "{told}");
        fs::remove_file(&path).expect("it goes");
        fs::rename(service.data_dir().join("away"), &path).expect("it is moved back");
        let client = Client::new(service.http);
        for _ in 0..300 {
            if client.get("/readyz").await.status().is_success() {
                break;
            }
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
        assert!(client.get("/readyz").await.status().is_success(), "{folder}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn folders_may_be_links_and_tops_of_file_systems() {
    let dir = made().await;
    let data = dir.path().join("data");
    for folder in ["instances", "results"] {
        fs::create_dir(data.join(folder).join("lost+found")).expect("a folder");
        fs::write(data.join(folder).join("lost+found/#12"), b"x").expect("a file");
        let elsewhere = dir.path().join(format!("elsewhere-{folder}"));
        fs::create_dir(&elsewhere).expect("a folder");
        for (index, entry) in fs::read_dir(data.join(folder)).expect("a folder").enumerate() {
            let path = entry.expect("an entry").path();
            if path.ends_with("lost+found") {
                continue;
            }
            let target = elsewhere.join(index.to_string());
            fs::rename(&path, &target).expect("it is moved");
            symlink(&target, &path).expect("a link");
        }
    }
    let service = phantom::settings().start_on(dir);
    let cloud = format!("/v1/series/{}/cloud", phantom::small().uid);
    assert!(!Client::new(service.http).bytes(&cloud).await.is_empty());
    assert!(
        !service.data_dir().join("set-aside").exists() || {
            fs::read_dir(service.data_dir().join("set-aside")).expect("a folder").next().is_none()
        }
    );
}

#[test]
fn a_file_in_the_place_of_a_folder_is_named() {
    let dir = tempfile::tempdir().expect("a folder");
    let data = dir.path().join("data");
    fs::create_dir_all(data.join("instances")).expect("a folder");
    fs::write(data.join("instances/3f"), b"").expect("a file");
    let output = phantom::settings().refused(&data);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && told.contains("instances/3f"), "{told}");
    assert!(!told.contains("internal error"), "{told}");
}
