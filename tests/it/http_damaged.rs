//! A stored result whose bytes changed, or whose file is gone, is told; nothing of it passes for whole.

use std::fs;
use std::path::PathBuf;

use serde_json::json;
use triplanar::store::ReconstructionId;

use crate::support::http::{Server, problem};

/// The file of that name in the only result of a reconstruction.
fn file(server: &Server, id: ReconstructionId, name: &str) -> PathBuf {
    let result = server.config.storage.data_dir.join(format!("results/{id}"));
    let mut leases: Vec<_> =
        fs::read_dir(result).expect("a result").map(|entry| entry.unwrap().path()).collect();
    assert_eq!(leases.len(), 1, "one result: {leases:?}");
    leases.remove(0).join(name)
}

/// Changes one bit in the middle of a file.
fn flip(path: &PathBuf) {
    let mut bytes = fs::read(path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x10;
    fs::write(path, bytes).unwrap();
}

#[tokio::test]
async fn a_file_that_is_gone_is_damage_and_not_a_reconstruction_that_never_was() {
    let server = Server::start().await;
    let (uid, id) = server.succeeded(1).await;
    for (name, path) in [
        ("report.json", format!("/v1/reconstructions/{id}/report")),
        ("axial.ply", format!("/v1/reconstructions/{id}/cloud?plane=axial")),
        ("triplanar.ply", format!("/v1/reconstructions/{id}/cloud")),
        ("triplanar.ply", format!("/v1/series/{uid}/cloud?format=ply_ascii")),
    ] {
        let file = file(&server, id, name);
        let bytes = fs::read(&file).unwrap();
        fs::remove_file(&file).unwrap();
        let told = problem(server.get(&path).send().await.unwrap(), 500, "result-damaged").await;
        assert!(told["detail"].as_str().unwrap().contains(&format!("{name} is missing")), "{told}");
        fs::write(&file, bytes).unwrap();
        assert_eq!(server.get(&path).send().await.unwrap().status(), 200, "the file is back: {path}");
    }
    assert!(server.store.delete_reconstruction(id).await.unwrap());
    let removed = server.get(&format!("/v1/reconstructions/{id}/cloud")).send().await.unwrap();
    problem(removed, 404, "not-found").await;
    assert!(
        !server.config.storage.data_dir.join(format!("results/{id}")).exists(),
        "hashes go with their files"
    );
}

#[tokio::test]
async fn a_damaged_result_is_made_again_when_it_is_asked_for_again() {
    let server = Server::start().await;
    let (uid, id) = server.succeeded(1).await;
    let again = || server.post(&format!("/v1/series/{uid}/reconstructions")).json(&json!({})).send();
    let unharmed: serde_json::Value = again().await.unwrap().json().await.unwrap();
    assert_eq!(unharmed["state"], "succeeded", "a whole one is given back as it is");

    flip(&file(&server, id, "sagittal.ply"));
    let asked = again().await.unwrap();
    let told: serde_json::Value = asked.json().await.unwrap();
    assert_eq!((told["id"].as_str(), told["state"].as_str()), (Some(&*id.to_string()), Some("queued")));
    server.finish(&uid).await;
    let whole = server.get(&format!("/v1/reconstructions/{id}/cloud?plane=sagittal")).send().await.unwrap();
    assert_eq!(whole.status(), 200);
    file(&server, id, "sagittal.ply");
}
