//! What release 0.1 made with a decoder at fault is never served as if it were good: its doubt stands
//! wherever doubts do, and `revision=current` waits for what is made in its place.

use std::path::Path;

use reqwest::Response;
use serde_json::{Value, json};
use sqlx::{AssertSqlSafe, Connection as _};

use crate::support::client::Client;
use crate::support::http::{Server, problem, slices};
use crate::support::{pacs, phantom};

/// As a catalog of 0.1 becomes whose instances are JPEG Lossless: version 0 of its algorithm.
async fn made_by_0_1(data_dir: &Path, profile: &str) {
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(data_dir.join("catalog.sqlite"));
    let mut connection = sqlx::SqliteConnection::connect_with(&options).await.unwrap();
    let statement = format!(
        "UPDATE reconstructions SET algorithm = '{profile}/0', parameters_sha256 = randomblob(32), \
         software = 'triplanar 0.1.0'"
    );
    let done = sqlx::query(AssertSqlSafe(statement)).execute(&mut connection).await.unwrap();
    assert!(done.rows_affected() > 0);
    connection.close().await.unwrap();
}

fn header(response: &Response, name: &str) -> String {
    response.headers().get(name).unwrap_or_else(|| panic!("no {name}")).to_str().unwrap().to_owned()
}

async fn json_of(server: &Server, path: &str) -> Value {
    server.get(path).send().await.unwrap().json().await.unwrap()
}

#[tokio::test]
async fn it_carries_its_doubt_everywhere_and_is_not_current() {
    let server = Server::start().await;
    let (uid, old) = server.succeeded(1).await;
    let (cloud, report) = (format!("/v1/series/{uid}/cloud"), format!("/v1/series/{uid}/report"));
    let body = server.get(&cloud).send().await.unwrap().bytes().await.unwrap();
    made_by_0_1(&server.config.storage.data_dir, "paper").await;
    let by_id = format!("/v1/reconstructions/{old}/cloud");
    for path in [&cloud, &report, &by_id, &format!("/v1/reconstructions/{old}/report")] {
        let response = server.get(path).send().await.unwrap();
        assert_eq!(response.status(), 200, "{path}");
        assert_eq!(header(&response, "triplanar-doubts"), "former_decoder", "{path}");
    }
    let same = server.get(&cloud).send().await.unwrap().bytes().await.unwrap();
    assert_eq!(same, body, "no word of it in a file");
    let doubted = async || {
        let series = json_of(&server, &format!("/v1/series/{uid}")).await;
        let listed = json_of(&server, "/v1/series").await["items"][0]["doubts"].clone();
        let details: Vec<Value> = series["doubt_details"].as_array().unwrap().clone();
        assert!(details.iter().all(|detail| detail["detail"].as_str().unwrap().contains("JPEG Lossless")));
        assert_eq!((series["doubts"].as_array().unwrap().len(), &listed), (details.len(), &series["doubts"]));
        listed
    };
    assert_eq!(doubted().await, json!(["former_decoder"]));
    let row = json_of(&server, &format!("/v1/reconstructions/{old}")).await;
    assert_eq!(row["transfer_doubts"], json!(["former_decoder"]));
    let waits = async |state: &str| {
        for path in [&cloud, &report] {
            let response = server.get(&format!("{path}?revision=current")).send().await.unwrap();
            assert!(header(&response, "retry-after").parse::<u32>().unwrap() > 0);
            let told = problem(response, 409, "not-current").await["detail"].as_str().unwrap().to_owned();
            assert!(told.contains(state) && told.contains("JPEG Lossless"), "{told}");
        }
    };
    waits("succeeded").await;

    // Asked for again, it is served until the new one is there.
    let path = format!("/v1/series/{uid}/reconstructions");
    let told: Value = server.post(&path).send().await.unwrap().json().await.unwrap();
    assert_eq!((&told["state"], &told["transfer_doubts"]), (&json!("queued"), &json!([])), "{told:#}");
    waits("queued").await;
    assert_eq!(doubted().await, json!(["former_decoder"]));
    server.finish(&uid).await;
    let response = server.get(&format!("{cloud}?revision=current")).send().await.unwrap();
    assert_eq!(response.status(), 200);
    assert_eq!(header(&response, "triplanar-doubts"), "none");
    assert_eq!(json!(header(&response, "triplanar-reconstruction")), told["id"]);
    assert_eq!(doubted().await, json!([]));
    let former = server.get(&by_id).send().await.unwrap();
    assert_eq!(header(&former, "triplanar-doubts"), "former_decoder", "by its id it stays what it is");

    // A later revision supersedes it: by its id it is served, with its doubt.
    server.upload("", slices(1, 11)[10].part10()).await;
    let done = server.post(&format!("/v1/series/{uid}/complete")).send().await.unwrap();
    assert_eq!(done.status(), 202);
    server.finish(&uid).await;
    let row = json_of(&server, &format!("/v1/reconstructions/{old}")).await;
    assert_eq!(
        (&row["state"], &row["transfer_doubts"]),
        (&json!("superseded"), &json!(["former_decoder"])),
        "{row:#}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn it_is_made_again_at_start_and_the_new_one_takes_its_place() {
    let service = phantom::settings().start();
    let uid = &phantom::small().uid;
    pacs::push(&service, &phantom::small().files).await;
    let old = Client::new(service.http).settled(uid, 1).await[0]["id"].clone();
    let (status, dir) = service.terminate();
    assert!(status.success());
    made_by_0_1(&dir.path().join("data"), "precise").await;
    let service = phantom::settings().start_on(dir);
    let client = Client::new(service.http);
    let rows = client.settled(uid, 2).await;
    assert!(rows.iter().all(|row| row["state"] == "succeeded"), "{rows:#?}");
    let response = client.get(&format!("/v1/series/{uid}/cloud?revision=current")).await;
    assert_eq!(response.status(), 200);
    assert_ne!(json!(header(&response, "triplanar-reconstruction")), old);
    assert!(!header(&response, "triplanar-doubts").contains("former_decoder"));
    assert_eq!(client.json(&format!("/v1/series/{uid}")).await["doubts"], json!([]));
}
