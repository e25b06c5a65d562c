//! STOW-RS (PS3.18 section 10.5).

use serde_json::Value;

use crate::support::http::{Server, problem, slices};
use crate::support::slice::{CT, Slice};

/// A multipart/related body; `None` is no media type on the part.
fn related(boundary: &str, parts: &[(Option<&str>, &[u8])]) -> Vec<u8> {
    let mut body = b"a preamble that is ignored\r\n".to_vec();
    for (media_type, bytes) in parts {
        body.extend(format!("--{boundary}\r\n").bytes());
        if let Some(media_type) = media_type {
            body.extend(format!("Content-Type: {media_type}\r\n").bytes());
        }
        body.extend(b"\r\n");
        body.extend_from_slice(bytes);
        body.extend(b"\r\n");
    }
    body.extend(format!("--{boundary}--\r\n").bytes());
    body
}

const DICOM: Option<&str> = Some("application/dicom");

async fn store(server: &Server, path: &str, content_type: &str, body: Vec<u8>) -> reqwest::Response {
    server.post(path).header("content-type", content_type).body(body).send().await.unwrap()
}

async fn answer(response: reqwest::Response, status: u16) -> Value {
    assert_eq!(response.headers()["content-type"], "application/dicom+json");
    let got = response.status();
    let told: Value = response.json().await.unwrap();
    assert_eq!(got, status, "{told}");
    told
}

#[tokio::test]
async fn instances_are_stored_whatever_the_boundary_is_written_like() {
    let server = Server::start().await;
    let instances = slices(1, 4);
    let files: Vec<_> = instances.iter().map(Slice::part10).collect();
    for (content_type, boundary, file) in [
        ("multipart/related; type=\"application/dicom\"; boundary=abc", "abc", &files[0]),
        (
            "multipart/related; boundary=\"=_ quoted :1\"; type=\"application/dicom\"",
            "=_ quoted :1",
            &files[1],
        ),
        ("Multipart/Related;TYPE=application/dicom;BOUNDARY=x", "x", &files[2]),
    ] {
        let response =
            store(&server, "/dicom-web/studies", content_type, related(boundary, &[(DICOM, file)])).await;
        let told = answer(response, 200).await;
        assert_eq!(told["00081199"]["Value"][0]["00081150"]["Value"][0], CT);
        assert!(told.get("00081198").is_none());
    }
    let single = store(&server, "/dicom-web/studies", "application/dicom", files[3].clone()).await;
    let told = answer(single, 200).await;
    let item = &told["00081199"]["Value"][0];
    assert_eq!(item["00081155"], serde_json::json!({ "vr": "UI", "Value": [instances[3].sop_uid()] }));
    // PS3.18 annex I: present and empty, for nothing is served back.
    assert_eq!(item["00081190"], serde_json::json!({ "vr": "UR" }));
}

#[tokio::test]
async fn the_stored_bytes_are_those_that_were_sent() {
    let server = Server::start().await;
    let mut slice = Slice::of(1, 1);
    slice.value = i16::from_le_bytes(*b"\r\n");
    let body = related("xx", &[(DICOM, &slice.part10())]);
    answer(store(&server, "/dicom-web/studies", "multipart/related; boundary=xx", body).await, 200).await;
    let instances = server.store.instances(&slice.series_uid()).await.unwrap();
    let source = server.store.instance_source(&instances);
    let stored = triplanar::dicom::source::InstanceSource::read(&source, 0).unwrap();
    assert!(stored.ends_with(&slice.data_set()), "the data set is untouched");
}

#[tokio::test]
async fn refused_instances_have_their_failure_reason() {
    let server = Server::start().await;
    let good = Slice::of(1, 1);
    let mut secondary = Slice::of(1, 2);
    secondary.sop_class = "1.2.840.10008.5.1.4.1.1.7";
    let parts = [
        (DICOM, good.part10()),
        (DICOM, secondary.part10()),
        (DICOM, b"nonsense".to_vec()),
        (Some("application/dicom+xml"), b"<x/>".to_vec()),
    ];
    let parts: Vec<_> = parts.iter().map(|(media_type, bytes)| (*media_type, bytes.as_slice())).collect();
    let content_type = "multipart/related; type=\"application/dicom\"; boundary=b";
    let told =
        answer(store(&server, "/dicom-web/studies", content_type, related("b", &parts)).await, 202).await;
    assert_eq!(told["00081199"]["Value"].as_array().unwrap().len(), 1);
    let failed = &told["00081198"]["Value"][0];
    assert_eq!(failed["00081155"]["Value"][0], secondary.sop_uid().as_str());
    assert_eq!(failed["00081197"], serde_json::json!({ "vr": "US", "Value": [0x0122] }));
    // Those of which nothing is known.
    assert_eq!(told["0008119A"]["Value"][0]["00081197"]["Value"][0], 0xC000);
    assert_eq!(told["0008119A"]["Value"].as_array().unwrap().len(), 2);

    let all_refused = related("b", &[(DICOM, &secondary.part10())]);
    answer(store(&server, "/dicom-web/studies", content_type, all_refused).await, 409).await;
}

#[tokio::test]
async fn a_request_says_how_many_instances_its_series_has_in_all() {
    let server = Server::start().await;
    let instances = slices(1, 3);
    let files: Vec<_> = instances.iter().map(Slice::part10).collect();
    let parts: Vec<_> = files.iter().map(|file| (DICOM, file.as_slice())).collect();
    let content_type = "multipart/related; type=\"application/dicom\"; boundary=b";
    let of_study = "/dicom-web/studies/1.2.826.0.1.3680043.10.9999.7.1";
    for wrong in ["0", "-1", "abc", "1000001"] {
        for path in ["/dicom-web/studies", of_study] {
            let body = related("b", &parts[..1]);
            let response = store(&server, &format!("{path}?expect={wrong}"), content_type, body).await;
            problem(response, 400, "invalid-parameter").await;
        }
    }
    let uid = instances[0].series_uid();
    assert!(server.store.series(&uid).await.unwrap().is_none());
    let first = store(&server, "/dicom-web/studies?expect=3", content_type, related("b", &parts[..2])).await;
    answer(first, 200).await;
    let series = server.store.series(&uid).await.unwrap().unwrap();
    assert_eq!((series.state.name(), series.expected_instances), ("receiving", Some(3)));
    let rest = store(&server, &format!("{of_study}?expect=3"), content_type, related("b", &parts[2..])).await;
    answer(rest, 200).await;
    assert_eq!(server.store.series(&uid).await.unwrap().unwrap().state.name(), "complete");
}

#[tokio::test]
async fn a_parameter_that_is_not_known_is_ignored_with_a_warning() {
    let server = Server::start().await;
    let part = Slice::of(1, 1).part10();
    for (query, warns) in [("", false), ("?expect=2", false), ("?expct=2", true)] {
        let path = format!("/dicom-web/studies{query}");
        let response = store(&server, &path, "application/dicom", part.clone()).await;
        assert_eq!(response.headers().contains_key("warning"), warns, "{query}");
        answer(response, 200).await;
    }
}

#[tokio::test]
async fn a_request_has_no_more_parts_than_an_archive_files() {
    let server = Server::with(|config| config.http.max_archive_entries = 3).await;
    let content_type = "multipart/related; type=\"application/dicom\"; boundary=b";
    for part in [(DICOM, b"".as_slice()), (Some("text/plain"), b"x")] {
        let post =
            |count| store(&server, "/dicom-web/studies", content_type, related("b", &vec![part; count]));
        let told = answer(post(3).await, 409).await;
        assert_eq!(told["0008119A"]["Value"].as_array().unwrap().len(), 3);
        problem(post(4).await, 413, "archive-too-large").await;
    }
}

#[tokio::test]
async fn an_instance_of_another_study_is_not_stored() {
    let server = Server::start().await;
    let slice = Slice::of(1, 1);
    let content_type = "multipart/related; boundary=b";
    let body = related("b", &[(DICOM, &slice.part10())]);
    let told =
        answer(store(&server, "/dicom-web/studies/1.2.3", content_type, body.clone()).await, 409).await;
    assert_eq!(told["00081198"]["Value"][0]["00081197"]["Value"][0], 0xA900);
    assert!(server.store.series(&slice.series_uid()).await.unwrap().is_none());
    let right = "/dicom-web/studies/1.2.826.0.1.3680043.10.9999.7.1";
    answer(store(&server, right, content_type, body).await, 200).await;
}

#[tokio::test]
async fn requests_that_are_no_stow_are_problems() {
    let server = Server::start().await;
    let path = "/dicom-web/studies";
    let part = Slice::of(1, 1).part10();
    let mut cut = related("b", &[(DICOM, &part)]);
    cut.truncate(cut.len() - 10);
    problem(store(&server, path, "multipart/related; boundary=b", cut).await, 400, "malformed-upload").await;
    let none = related("b", &[]);
    problem(store(&server, path, "multipart/related; boundary=b", none).await, 422, "empty-upload").await;
    let whole = related("b", &[(DICOM, &part)]);
    problem(store(&server, path, "multipart/related", whole.clone()).await, 400, "malformed-upload").await;
    let xml = "multipart/related; type=\"application/dicom+xml\"; boundary=b";
    problem(store(&server, path, xml, whole.clone()).await, 415, "unsupported-media-type").await;
    problem(store(&server, path, "application/json", whole.clone()).await, 415, "unsupported-media-type")
        .await;
    problem(
        store(&server, "/dicom-web/studies/1..2", "application/dicom", whole).await,
        400,
        "invalid-parameter",
    )
    .await;
    let unacceptable = server
        .post(path)
        .header("accept", "application/dicom+xml")
        .header("content-type", "application/dicom");
    problem(unacceptable.body(part).send().await.unwrap(), 406, "not-acceptable").await;
}
