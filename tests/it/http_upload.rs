//! `POST /v1/series`: every way in which people have a series.

use std::io::Write;

use reqwest::multipart::{Form, Part};

use crate::support::http::{SLICES, Server, problem, slices, zip_of, zipped};
use crate::support::slice::Slice;

/// A tar of `extra`, and then of a whole series in deep folders.
fn tarred(series: u32, extra: &[(&str, &[u8])]) -> Vec<u8> {
    let mut archive = tar::Builder::new(Vec::new());
    let files = slices(series, SLICES)
        .into_iter()
        .map(|s| (format!("{}/{}", "deep/".repeat(30), s.number), s.part10()));
    let extra = extra.iter().map(|(name, bytes)| ((*name).to_owned(), bytes.to_vec()));
    for (name, bytes) in extra.chain(files) {
        let mut header = tar::Header::new_gnu();
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        header.set_cksum();
        archive.append_data(&mut header, name, bytes.as_slice()).unwrap();
    }
    archive.into_inner().unwrap()
}

fn gzipped(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[tokio::test]
async fn a_zip_with_folders_and_other_files_becomes_a_complete_series() {
    let server = Server::start().await;
    let instances: Vec<_> = slices(1, SLICES).iter().map(Slice::part10).collect();
    let directory = Slice { sop_class: "1.2.840.10008.1.3.10", ..Slice::default() }.part10();
    let archive = zipped(&[
        ("CD/", b""),
        ("CD/README.TXT", b"not an image"),
        ("CD/DIRFILE", &directory),
        ("CD/IM0", &instances[0]),
        ("CD/empty", b""),
        ("CD/deep/", b""),
        ("CD/deep/IM1", &instances[1]),
        ("CD/deep/IM2", &instances[2]),
        ("CD/deep/IM3", &instances[3]),
        ("CD/again", &instances[3]),
    ]);
    let told = server.upload("", archive).await;
    assert_eq!(
        told["instances"]["stored"].as_u64().unwrap() + told["instances"]["duplicate"].as_u64().unwrap(),
        5
    );
    assert_eq!(told["instances"]["refused"], 0);
    let skipped: Vec<_> = told["skipped"]
        .as_array()
        .unwrap()
        .iter()
        .map(|s| (s["name"].as_str().unwrap(), s["reason"].as_str().unwrap()))
        .collect();
    assert_eq!(skipped, [("CD/README.TXT", "not_dicom"), ("CD/DIRFILE", "dicomdir"), ("CD/empty", "empty")]);
    let series = &told["series"][0]["series"];
    assert_eq!((series["state"].as_str(), series["instances"].as_u64()), (Some("complete"), Some(4)));
    assert_eq!(series["complete_reason"], "upload_ended");
    assert_eq!(told["series"][0]["reconstruction"]["state"], "queued");
}

#[tokio::test]
async fn tar_gzip_and_a_single_file_are_told_by_their_bytes() {
    let server = Server::start().await;
    for (series, archive) in [(1, tarred(1, &[])), (2, gzipped(&tarred(2, &[("x.txt", b"text")])))] {
        let told = server.upload("", archive).await;
        assert_eq!(told["instances"]["stored"], SLICES, "series {series}");
        assert_eq!(told["series"][0]["series"]["state"], "complete");
    }
    for body in [Slice::of(3, 300).part10(), gzipped(&Slice::of(3, 301).part10())] {
        let told = server.upload("?expect=9", body).await;
        assert_eq!(told["instances"]["stored"], 1);
    }
}

#[tokio::test]
async fn a_browsers_form_may_hold_files_and_archives() {
    let server = Server::start().await;
    let form = Form::new()
        .text("comment", "not a file")
        .part("files", Part::bytes(zip_of(1, 2)).file_name("half.zip"))
        .part("files", Part::bytes(Slice::of(1, 102).part10()).file_name("IM2"))
        .part("files", Part::bytes(Slice::of(1, 103).part10()).file_name("Ünïcode \"3\".dcm"))
        .part("files", Part::bytes(b"text".to_vec()).file_name("README"));
    let response = server.post("/v1/series").multipart(form).send().await.unwrap();
    assert_eq!(response.status(), 202);
    let told: serde_json::Value = response.json().await.unwrap();
    assert_eq!(told["instances"]["stored"], 4);
    assert_eq!(told["skipped"][0]["name"], "README");
    assert_eq!(told["series"][0]["series"]["state"], "complete");
}

#[tokio::test]
async fn with_an_expected_number_a_series_waits_for_it() {
    let server = Server::start().await;
    let all = slices(1, 3);
    for (index, slice) in all.iter().enumerate() {
        let told = server.upload("?expect=3", slice.part10()).await;
        let state = if index < 2 { "receiving" } else { "complete" };
        assert_eq!(told["series"][0]["series"]["state"], state, "after {index}");
    }
    let told: serde_json::Value = server
        .get(&format!("/v1/series/{}", all[0].series_uid()))
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    assert_eq!(told["complete_reason"], "expected_instances");
}

#[tokio::test]
async fn what_holds_no_instance_is_a_problem_that_says_so() {
    let server = Server::start().await;
    let post = |body: Vec<u8>| server.post("/v1/series").body(body).send();
    let told = problem(post(zipped(&[("a.txt", b"text")])).await.unwrap(), 422, "empty-upload").await;
    assert_eq!(told["skipped"][0]["name"], "a.txt");
    problem(post(b"no DICOM at all".to_vec()).await.unwrap(), 400, "not-dicom").await;
    problem(post(Vec::new()).await.unwrap(), 400, "malformed-upload").await;
    let whole = zip_of(1, 2);
    problem(post(whole[..whole.len() / 2].to_vec()).await.unwrap(), 400, "malformed-upload").await;
    let mut secondary = Slice::of(1, 1);
    secondary.sop_class = "1.2.840.10008.5.1.4.1.1.7";
    let told = problem(
        post(zipped(&[("sc.dcm", &secondary.part10())])).await.unwrap(),
        422,
        "unsupported-sop-class",
    )
    .await;
    assert_eq!(told["refused"][0]["name"], "sc.dcm");
    let text = server.post("/v1/series").header("content-type", "text/plain").body("x").send().await.unwrap();
    problem(text, 415, "unsupported-media-type").await;
    problem(server.post("/v1/series?expect=0").body("x").send().await.unwrap(), 400, "invalid-parameter")
        .await;
    problem(server.post("/v1/series?expct=1").body("x").send().await.unwrap(), 400, "invalid-parameter")
        .await;
}

#[tokio::test]
async fn one_broken_file_of_a_zip_spoils_no_other() {
    let server = Server::start().await;
    let mut archive = zip_of(1, SLICES);
    // In the first entry's data, well behind its header.
    archive[120] ^= 0xff;
    let told = server.upload("", archive).await;
    assert_eq!(told["instances"]["stored"], SLICES - 1);
    assert_eq!(told["refused"][0]["code"], "malformed-upload");
}

#[tokio::test]
async fn other_pixels_under_a_stored_uid_are_refused_and_named() {
    let server = Server::start().await;
    server.upload("", zip_of(1, SLICES)).await;
    let mut other = slices(1, 1).remove(0);
    other.value = 99;
    let response = server.post("/v1/series").body(other.part10()).send().await.unwrap();
    problem(response, 409, "conflicting-instance").await;
    let told: serde_json::Value =
        server.get(&format!("/v1/series/{}", other.series_uid())).send().await.unwrap().json().await.unwrap();
    assert_eq!(told["refused"][0]["code"], "conflicting-instance");
    assert_eq!(told["refused"][0]["sop_instance_uid"], other.sop_uid().as_str());
}

#[tokio::test]
async fn bombs_and_bodies_beyond_a_limit_are_refused() {
    let server = Server::with(|config| {
        config.http.max_upload_bytes = 300_000;
        config.http.max_unpacked_bytes = 1_000_000;
        config.http.max_archive_entries = 5;
    })
    .await;
    let post = |body: Vec<u8>| server.post("/v1/series").body(body).send();
    let mut instance = Slice::of(1, 1).part10();
    instance.resize(3_000_000, 0);
    problem(post(zipped(&[("bomb", &instance)])).await.unwrap(), 413, "archive-too-large").await;
    problem(post(gzipped(&instance)).await.unwrap(), 413, "archive-too-large").await;
    // What is passed over counts too; here it comes before any instance.
    let zeros = vec![0; 3_000_000];
    problem(post(gzipped(&tarred(1, &[("zeros", &zeros)]))).await.unwrap(), 413, "archive-too-large").await;
    problem(post(zip_of(1, 6)).await.unwrap(), 413, "archive-too-large").await;
    problem(post(vec![0; 300_001]).await.unwrap(), 413, "too-large").await;
    let pieces = (0..20).map(|_| Ok::<_, std::io::Error>(vec![0_u8; 65_536]));
    let chunked = reqwest::Body::wrap_stream(futures_util::stream::iter(pieces));
    problem(server.post("/v1/series").body(chunked).send().await.unwrap(), 413, "too-large").await;
    // Whole instances ahead of a limit would have been stored: there were none.
    assert!(server.store.list_series(&Default::default(), None, 10).await.unwrap().rows.is_empty());
}

#[tokio::test]
async fn limits_hold_for_all_archives_of_a_form_together() {
    let tar = tarred(1, &[]);
    let form = |archives: &[Vec<u8>]| {
        archives.iter().fold(Form::new(), |form, archive| {
            form.part("files", Part::bytes(archive.clone()).file_name("archive"))
        })
    };
    // Each archive is a file of the form too.
    let zips: Vec<_> = (1..=3).map(|series| zip_of(series, 3)).collect();
    let server = Server::with(|config| config.http.max_archive_entries = 2 * (1 + 3)).await;
    let post = |archives| server.post("/v1/series").multipart(form(archives)).send();
    problem(post(&zips).await.unwrap(), 413, "archive-too-large").await;
    assert_eq!(post(&zips[..2]).await.unwrap().status(), 202);

    let server = Server::with(|config| config.http.max_unpacked_bytes = tar.len() as u64 * 3 / 2).await;
    let post = |archives| server.post("/v1/series").multipart(form(archives)).send();
    let twice = [gzipped(&tar), gzipped(&tar)];
    problem(post(&twice).await.unwrap(), 413, "archive-too-large").await;
    assert_eq!(post(&twice[..1]).await.unwrap().status(), 202);
}
