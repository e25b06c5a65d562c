//! A slice's picture is drawn from what was stored with the result, and is the same for ever.

use serde_json::json;
use triplanar::reconstruction::pictures::Pictures;

use crate::support::client::Client;
use crate::support::{pacs, phantom};

#[tokio::test(flavor = "multi_thread")]
async fn a_picture_outlives_its_instances_and_says_how_it_was_drawn() {
    let series = phantom::small();
    let service = phantom::settings().start();
    pacs::push(&service, &series.files).await;
    let client = Client::new(service.http);
    let row = client.settled(&series.uid, 1).await.remove(0);
    assert_eq!(row["state"], "succeeded", "{row:#}");
    let path = format!("/v1/reconstructions/{}/slices", row["id"].as_str().unwrap());
    let mut before = Vec::new();
    for plane in ["axial", "sagittal", "coronal"] {
        let response = client.get(&format!("{path}/{plane}/5.png")).await;
        assert_eq!(response.status(), 200);
        assert_eq!(response.headers()["triplanar-picture"], "stored");
        assert_eq!(response.headers()["triplanar-reconstruction"].to_str().unwrap(), row["id"]);
        before.push(response.bytes().await.unwrap());
    }
    assert_eq!(client.get(&format!("{path}/axial/99999.png")).await.status(), 404);

    // The file holds a picture of every slice, and all of it is less than the limit of a head.
    let results = service.data_dir().join("results").join(row["id"].as_str().unwrap());
    let attempt = std::fs::read_dir(&results).unwrap().next().unwrap().unwrap().path();
    let file = std::fs::read(attempt.join("pictures.bin")).expect("stored with the result");
    assert!(file.len() <= 30_000_000, "{} bytes", file.len());
    assert!(Pictures::open(&file).is_ok());

    // Without any instance left there is nothing to draw from but what was stored.
    let dir = service.kill();
    let catalog = dir.path().join("data/catalog.sqlite");
    remove_instances(&catalog).await;
    let service = phantom::settings().start_on(dir);
    let client = Client::new(service.http);
    for (plane, before) in ["axial", "sagittal", "coronal"].into_iter().zip(before) {
        assert!(client.bytes(&format!("{path}/{plane}/5.png")).await == before, "{plane}: another picture");
    }
    // They go with the result.
    let removed = client.request(reqwest::Method::DELETE, path.trim_end_matches("/slices")).send().await;
    assert_eq!(json!(removed.unwrap().status().as_u16()), 204);
    assert!(!attempt.join("pictures.bin").exists());
}

async fn remove_instances(catalog: &std::path::Path) {
    use sqlx::Connection as _;
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(catalog);
    let mut connection = sqlx::SqliteConnection::connect_with(&options).await.unwrap();
    for statement in ["DELETE FROM instances", "UPDATE series SET instances = 0, bytes = 0"] {
        sqlx::query(statement).execute(&mut connection).await.unwrap();
    }
    connection.close().await.unwrap();
}
