//! What uploads and STOW-RS requests hold is within the memory budget.

use reqwest::multipart::{Form, Part};

use crate::support::http::{Server, problem, slices, zip_of, zipped};

const MIB: u64 = 1 << 20;
/// What one upload takes of the budget, as `config/triplanar.toml` says.
const UPLOAD: u64 = 24 * MIB;

/// The budget is told, and when to come again.
async fn refused(response: reqwest::Response) {
    assert_eq!(response.headers()["retry-after"], "5");
    let told = problem(response, 503, "busy").await;
    assert!(told["detail"].as_str().unwrap().contains("memory.budget_bytes"), "{told}");
}

#[tokio::test]
async fn an_upload_for_which_the_budget_has_no_room_is_told_to_come_again() {
    let server = Server::with(|config| config.memory.budget_bytes = UPLOAD - 1).await;
    let instance = slices(1, 1)[0].part10();
    refused(server.post("/v1/series").body(zip_of(1, 3)).send().await.unwrap()).await;
    refused(server.post("/v1/series").body(instance.clone()).send().await.unwrap()).await;
    for path in ["/dicom-web/studies", "/dicom-web/studies/1.2.3"] {
        let request = server.post(path).header("content-type", "application/dicom");
        refused(request.body(instance.clone()).send().await.unwrap()).await;
    }
    let listed: serde_json::Value = server.get("/v1/series").send().await.unwrap().json().await.unwrap();
    assert_eq!(listed["items"].as_array().unwrap().len(), 0, "nothing of them is stored");
}

#[tokio::test]
async fn an_upload_gives_its_memory_back_however_it_ends() {
    // One at a time, and what it remembers of its files.
    let server = Server::with(|config| config.memory.budget_bytes = UPLOAD + MIB).await;
    let (slow, beside) = server.filled_by_an_upload().await;
    refused(beside).await;
    drop(slow);
    server.room_for_an_upload().await;
    for series in 1..4 {
        server.upload("", zip_of(series, 3)).await;
    }
}

#[tokio::test]
async fn what_is_told_of_many_files_is_counted_too() {
    // 512 files to begin with, and no more.
    let server = Server::with(|config| config.memory.budget_bytes = UPLOAD + MIB).await;
    let names: Vec<String> = (0..600).map(|number| format!("CD/{number}.TXT")).collect();
    let files: Vec<_> = names.iter().map(|name| (name.as_str(), b"no image".as_slice())).collect();
    let few = server.post("/v1/series").body(zipped(&files[..500])).send().await.unwrap();
    assert_eq!(problem(few, 422, "empty-upload").await["skipped"].as_array().unwrap().len(), 500);
    refused(server.post("/v1/series").body(zipped(&files)).send().await.unwrap()).await;
    server.upload("", zip_of(1, 3)).await;
}

#[tokio::test]
async fn a_files_name_is_no_way_to_fill_the_memory() {
    let server = Server::start().await;
    let part = |name: String| Part::bytes(b"no image".to_vec()).file_name(name);
    let form = Form::new().part("files", part("n".repeat(15_000)));
    let told = server.post("/v1/series").multipart(form).send().await.unwrap();
    let told = problem(told, 422, "empty-upload").await;
    assert_eq!(told["skipped"][0]["name"], "n".repeat(255));
}
