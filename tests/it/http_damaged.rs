//! A stored result whose bytes changed, or whose file is gone, is told; nothing of it passes for whole.

use std::fs;
use std::path::PathBuf;

use std::time::Duration;

use serde_json::json;
use triplanar::cloud::{Format, PointCloud, encode};
use triplanar::geometry::{Frame, Plane, PlaneSet};
use triplanar::intake::{Announced, Encoding, Sender};
use triplanar::pipeline::Figures;
use triplanar::store::{Outcome, ReconstructionId};

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use uuid::Uuid;

use crate::support::http::{SLICES, Server, metadata, problem, slices};

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

/// A cloud of 1.5 MB, so that an answer has many blocks.
fn large() -> PointCloud {
    let points: Vec<[f32; 3]> = (0..60_000_u16).map(|i| [f32::from(i) * 0.013, -f32::from(i), 0.1]).collect();
    let n = points.len();
    PointCloud {
        points,
        planes: vec![PlaneSet::from_bits(1); n],
        unique: vec![false; n],
        normals: Vec::new(),
        errors: vec![0.25; n],
    }
}

/// A complete series whose instances came past the HTTP door: uploads need more of the memory budget than
/// answers do.
async fn series(server: &Server) {
    let sender = Uuid::new_v4();
    for slice in slices(1, SLICES) {
        let mut spool = server.intake.begin().await.unwrap();
        spool.write(&slice.part10()).await.unwrap();
        let announced = Announced {
            encoding: Encoding::Part10,
            sop_class_uid: None,
            sop_instance_uid: None,
            study_instance_uid: None,
            sender: Sender::Upload { id: sender },
        };
        server.intake.store(spool, announced).await.unwrap();
    }
    server.intake.upload_ended(sender).await.unwrap();
}

/// A reconstruction whose clouds are all that of [`large`], and the stored bytes of the merged one.
async fn with_large_clouds(server: &Server) -> (ReconstructionId, Vec<u8>) {
    series(server).await;
    let claim = server.store.claim("test", Duration::from_secs(60)).await.unwrap().expect("one waits");
    let (uid, id) = (claim.reconstruction.series_instance_uid.clone(), claim.lease.id);
    let clouds = [None, Some(Plane::Axial), Some(Plane::Sagittal), Some(Plane::Coronal)]
        .map(|plane| (plane, encode(&large(), &metadata(&uid, plane), Format::PlyBinary, Frame::Lps)));
    let stored = clouds[0].1.clone();
    let outcome = Outcome {
        clouds: clouds.into(),
        report: b"{}".to_vec(),
        figures: Figures::default(),
        quality: None,
        pictures: None,
    };
    assert!(server.store.finish_success(&claim.lease, &outcome).await.unwrap());
    (id, stored)
}

#[tokio::test]
async fn a_cloud_that_is_streamed_has_every_byte_in_every_form_and_part() {
    let server = Server::start().await;
    let (id, stored) = with_large_clouds(&server).await;
    let path = format!("/v1/reconstructions/{id}/cloud");
    let whole = server.get(&path).send().await.unwrap();
    assert_eq!(whole.content_length(), Some(stored.len() as u64));
    assert!(whole.bytes().await.unwrap() == stored);
    for (first, last) in
        [(0, 65_535), (65_535, 65_536), (700_000, 900_001), (stored.len() - 1, stored.len() - 1)]
    {
        let part = server.get(&path).header("range", format!("bytes={first}-{last}")).send().await.unwrap();
        assert_eq!(part.status(), 206);
        assert!(part.bytes().await.unwrap() == stored[first..=last], "{first} to {last}");
    }
    let ascii = encode(
        &large(),
        &metadata(&crate::support::slice::Slice::of(1, 0).series_uid(), None),
        Format::PlyAscii,
        Frame::Ras,
    );
    let path = format!("{path}?format=ply_ascii&frame=ras");
    assert!(server.get(&path).send().await.unwrap().bytes().await.unwrap() == ascii);
    let part = server.get(&path).header("range", "bytes=1000000-1200000").send().await.unwrap();
    assert!(part.bytes().await.unwrap() == ascii[1_000_000..=1_200_000]);
    let packed = server.get(&path).header("accept-encoding", "gzip").send().await.unwrap();
    assert_eq!(packed.headers()["content-encoding"], "gzip");
    let (mut unpacked, packed) = (Vec::new(), packed.bytes().await.unwrap());
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&*packed), &mut unpacked).unwrap();
    assert!(unpacked == ascii);
    let some = server.get(&format!("{path}&max_error_mm=0.25")).send().await.unwrap();
    assert!(some.text().await.unwrap().contains("element vertex 60000\n"), "every error is 0.25 mm");
}

#[tokio::test]
async fn an_answer_that_meets_a_damaged_block_breaks_off_and_is_never_whole() {
    let server = Server::start().await;
    let (id, stored) = with_large_clouds(&server).await;
    flip(&file(&server, id, "triplanar.ply"));
    let path = format!("/v1/reconstructions/{id}/cloud");
    let get = |path: &str| server.get(path);

    let begun = get(&path).send().await.unwrap();
    assert_eq!((begun.status().as_u16(), begun.content_length()), (200, Some(stored.len() as u64)));
    begun.bytes().await.expect_err("its client must see that it is not whole");
    let packed = get(&path).header("accept-encoding", "gzip").send().await.unwrap();
    packed.bytes().await.expect_err("nor is a compressed one whole");
    // Such an answer has neither length nor chunks.
    let mut old = tokio::net::TcpStream::connect(server.address).await.unwrap();
    let request = format!("GET {path} HTTP/1.0\r\nhost: localhost\r\naccept-encoding: gzip\r\n\r\n");
    old.write_all(request.as_bytes()).await.unwrap();
    old.read_to_end(&mut Vec::new()).await.expect_err("nor to HTTP/1.0: the connection is reset");
    let middle = stored.len() / 2;
    let harmed = get(&path).header("range", format!("bytes={}-", middle - 100_000)).send().await.unwrap();
    harmed.bytes().await.expect_err("nor a part that holds the damage");
    let harmed = get(&path).header("range", format!("bytes={middle}-")).send().await.unwrap();
    problem(harmed, 500, "result-damaged").await;
    let unharmed = get(&path).header("range", "bytes=0-199999").send().await.unwrap();
    assert!(unharmed.bytes().await.unwrap() == stored[..200_000], "what comes before it is as it was");
    // What must be read whole before its first byte is sent is refused as a whole.
    let text = get(&format!("{path}?format=ply_ascii")).send().await.unwrap();
    let told = problem(text, 500, "result-damaged").await;
    assert!(told["detail"].as_str().unwrap().contains("triplanar.ply"), "{told}");
    let other = get(&format!("{path}?plane=axial")).send().await.unwrap();
    assert_eq!(other.bytes().await.unwrap().len(), stored.len() - 4, "other files are not touched");
    let metrics = get("/metrics").send().await.unwrap().text().await.unwrap();
    assert!(metrics.contains("triplanar_results_damaged_total 6"), "{metrics}");
}

#[tokio::test]
async fn answers_beyond_the_memory_budget_are_told_to_come_again() {
    let server = Server::with(|config| config.memory.budget_bytes = 1).await;
    let (id, _) = with_large_clouds(&server).await;
    let refused = server.get(&format!("/v1/reconstructions/{id}/cloud")).send().await.unwrap();
    assert_eq!(refused.headers()["retry-after"], "5");
    let told = problem(refused, 503, "busy").await;
    assert!(told["detail"].as_str().unwrap().contains("memory.budget_bytes"), "{told}");
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
