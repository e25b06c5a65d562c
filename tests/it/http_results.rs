//! Clouds, reports and pictures over HTTP.

use reqwest::{Method, Response};
use serde_json::Value;
use triplanar::cloud::{Format, encode};
use triplanar::geometry::Frame;

use crate::support::http::{Server, cloud, metadata, problem, slices};

fn header(response: &Response, name: &str) -> String {
    response
        .headers()
        .get(name)
        .unwrap_or_else(|| panic!("no {name}: {response:?}"))
        .to_str()
        .unwrap()
        .to_owned()
}

#[tokio::test]
async fn a_cloud_is_served_in_every_format_and_frame_by_name_and_by_accept() {
    let server = Server::start().await;
    let (uid, id) = server.succeeded(1).await;
    for format in Format::ALL {
        for frame in [Frame::Lps, Frame::Ras] {
            let expected = encode(&cloud(), &metadata(&uid, None), format, frame);
            let by_name =
                format!("/v1/reconstructions/{id}/cloud?format={}&frame={}", format.name(), frame.name());
            let response = server.get(&by_name).send().await.unwrap();
            assert_eq!(header(&response, "content-type"), format.media_type());
            let end = format!(".{}\"", format.extension());
            assert!(header(&response, "content-disposition").ends_with(&end));
            assert_eq!(response.bytes().await.unwrap(), expected, "{} {}", format.name(), frame.name());
            let by_accept = format!("/v1/series/{uid}/cloud?frame={}", frame.name());
            let response = server.get(&by_accept).header("accept", format.media_type()).send().await.unwrap();
            assert_eq!(response.bytes().await.unwrap(), expected);
        }
    }
    let ply = server.get(&format!("/v1/series/{uid}/cloud?format=ply")).send().await.unwrap();
    assert_eq!(header(&ply, "content-type"), "application/x-ply", "`ply` is the binary one");
    // No point is of the axial plane alone: an empty cloud of that plane, in whatever form.
    let axial = server.get(&format!("/v1/series/{uid}/cloud?plane=axial&format=raw")).send().await.unwrap();
    assert_eq!((axial.status().as_u16(), axial.bytes().await.unwrap().len()), (200, 0));
}

#[tokio::test]
async fn a_cloud_can_be_asked_for_again_in_part_and_compressed() {
    let server = Server::start().await;
    let (uid, id) = server.succeeded(1).await;
    let path = format!("/v1/reconstructions/{id}/cloud");
    let whole = server.get(&path).send().await.unwrap();
    let tag = header(&whole, "etag");
    assert!(tag.starts_with('"') && tag.ends_with('"'), "strong: {tag}");
    assert_eq!(header(&whole, "accept-ranges"), "bytes");
    let whole = whole.bytes().await.unwrap();

    let other = server.get(&path).header("if-match", "\"x\"").header("range", "bytes=0-9");
    problem(other.send().await.unwrap(), 412, "precondition-failed").await;
    let same = server.get(&path).header("if-match", &tag).header("range", "bytes=0-9");
    assert_eq!(same.send().await.unwrap().status(), 206);

    let again = server.get(&path).header("if-none-match", format!("\"x\", {tag}")).send().await.unwrap();
    assert_eq!((again.status().as_u16(), header(&again, "etag")), (304, tag.clone()));
    let latest =
        server.get(&format!("/v1/series/{uid}/cloud")).header("if-none-match", &tag).send().await.unwrap();
    assert_eq!(latest.status(), 304);

    let part =
        server.get(&path).header("range", "bytes=10-19").header("if-range", &tag).send().await.unwrap();
    assert_eq!(part.status(), 206);
    assert_eq!(header(&part, "content-range"), format!("bytes 10-19/{}", whole.len()));
    assert_eq!(part.bytes().await.unwrap(), whole[10..20]);
    let changed =
        server.get(&path).header("range", "bytes=10-19").header("if-range", "\"old\"").send().await.unwrap();
    assert_eq!(changed.status(), 200);
    let outside = server.get(&path).header("range", "bytes=99999999-").send().await.unwrap();
    assert_eq!(header(&outside, "content-range"), format!("bytes */{}", whole.len()));
    problem(outside, 416, "range-not-satisfiable").await;

    let head = server.request(Method::HEAD, &path).send().await.unwrap();
    assert_eq!(header(&head, "content-length"), whole.len().to_string());
    assert_eq!(header(&head, "etag"), tag);
    assert!(head.bytes().await.unwrap().is_empty());

    let packed = server.get(&path).header("accept-encoding", "gzip").send().await.unwrap();
    assert_eq!(header(&packed, "content-encoding"), "gzip");
    assert_ne!(header(&packed, "etag"), tag, "another coding is another representation");
    let mut unpacked = Vec::new();
    let packed = packed.bytes().await.unwrap();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(packed.as_ref()), &mut unpacked).unwrap();
    assert_eq!(unpacked, whole);
}

#[tokio::test]
async fn what_cannot_be_served_says_why() {
    let server = Server::start().await;
    let (uid, id) = server.queued(1).await;
    let get = |path: String| server.get(&path).send();
    problem(get(format!("/v1/reconstructions/{id}/cloud")).await.unwrap(), 409, "reconstruction-state").await;
    problem(get(format!("/v1/reconstructions/{id}/report")).await.unwrap(), 409, "reconstruction-state")
        .await;
    problem(
        get(format!("/v1/reconstructions/{id}/slices/axial/0.png")).await.unwrap(),
        409,
        "reconstruction-state",
    )
    .await;
    problem(get(format!("/v1/series/{uid}/cloud")).await.unwrap(), 409, "series-incomplete").await;
    problem(get("/v1/series/1.2.3/cloud".into()).await.unwrap(), 404, "not-found").await;
    server.finish(&uid).await;
    let cloud = format!("/v1/reconstructions/{id}/cloud");
    problem(get(format!("{cloud}?format=stl")).await.unwrap(), 400, "invalid-parameter").await;
    problem(get(format!("{cloud}?plane=oblique")).await.unwrap(), 400, "invalid-parameter").await;
    problem(get(format!("{cloud}?frame=ijk")).await.unwrap(), 400, "invalid-parameter").await;
    problem(get(format!("{cloud}?fromat=ply_ascii")).await.unwrap(), 400, "invalid-parameter").await;
    problem(get(format!("{cloud}?max_error_mm=0.1")).await.unwrap(), 409, "no-expected-errors").await;
    for wrong in ["x", "-0.1", "nan", "inf", "1e9"] {
        let asked = get(format!("{cloud}?max_error_mm={wrong}")).await.unwrap();
        problem(asked, 400, "invalid-parameter").await;
    }
    let html = server.get(&cloud).header("accept", "text/html").send().await.unwrap();
    problem(html, 406, "not-acceptable").await;
}

#[tokio::test]
async fn a_report_is_served_as_json_and_as_csv() {
    let server = Server::start().await;
    let (uid, id) = server.succeeded(1).await;
    let json = server.get(&format!("/v1/reconstructions/{id}/report")).send().await.unwrap();
    assert_eq!(header(&json, "content-type"), "application/json");
    let json: Value = json.json().await.unwrap();
    assert_eq!(json["identity"]["series_instance_uid"], uid.as_str());
    assert_eq!(json["slices"].as_array().unwrap().len(), 10 + 8 + 8);
    let csv =
        server.get(&format!("/v1/series/{uid}/report")).header("accept", "text/csv").send().await.unwrap();
    assert!(header(&csv, "content-type").starts_with("text/csv"));
    let csv = csv.text().await.unwrap();
    assert_eq!(csv.lines().count(), 1 + 10 + 8 + 8);
    assert!(csv.starts_with("plane,index,accepted,reason"));
    let png =
        server.get(&format!("/v1/series/{uid}/report")).header("accept", "image/png").send().await.unwrap();
    problem(png, 406, "not-acceptable").await;
}

#[tokio::test]
async fn slices_are_pictures_however_many_ask_at_once() {
    let server = Server::start().await;
    let (_, id) = server.succeeded(1).await;
    let asked = (0..30).map(|i| {
        let plane = ["axial", "sagittal", "coronal"][i % 3];
        server.get(&format!("/v1/reconstructions/{id}/slices/{plane}/{}.png", i % 4)).send()
    });
    for (i, response) in futures_util::future::join_all(asked).await.into_iter().enumerate() {
        let (response, response_plane) = (response.unwrap(), ["axial", "sagittal", "coronal"][i % 3]);
        assert_eq!(
            (response.status().as_u16(), header(&response, "content-type")),
            (200, "image/png".to_owned())
        );
        let picture = image::load_from_memory(&response.bytes().await.unwrap()).expect("a PNG");
        // Pixels of 1 mm, slices 2 mm apart: upright pictures are twice as high as there are slices.
        let height = if response_plane == "axial" { 8 } else { 2 * 10 };
        assert_eq!((picture.width(), picture.height()), (8, height));
    }
    for nothing in ["axial/10.png", "oblique/0.png", "axial/0.jpg", "axial/-1.png", "axial/99999.png"] {
        let response =
            server.get(&format!("/v1/reconstructions/{id}/slices/{nothing}")).send().await.unwrap();
        problem(response, 404, "not-found").await;
    }
}

#[tokio::test]
async fn pictures_of_more_series_than_volumes_may_be_in_memory_take_turns() {
    for cached in [0, 1] {
        let server = Server::with(|config| config.http.cached_volumes = cached).await;
        let mut ids = Vec::new();
        for series in 1..=3 {
            ids.push(server.succeeded(series).await.1);
        }
        let asked = (0..10)
            .map(|i| server.get(&format!("/v1/reconstructions/{}/slices/axial/{i}.png", ids[i % 3])).send());
        for response in futures_util::future::join_all(asked).await {
            assert_eq!(response.unwrap().status(), 200, "{cached} cached");
        }
    }
}

#[tokio::test]
async fn pictures_of_removed_instances_are_gone() {
    let server = Server::start().await;
    let (uid, id) = server.succeeded(1).await;
    // Retention takes the source instances and leaves the result.
    let later = server.store.series(&uid).await.unwrap().unwrap().updated_ms + 400 * 86_400_000;
    let source_days = i64::from(server.config.storage.source_retention_days);
    let result_days = i64::from(server.config.storage.result_retention_days);
    assert!(source_days < result_days);
    let between = later - 400 * 86_400_000 + (source_days + 1) * 86_400_000;
    server.store.sweep(between).await.unwrap();
    let response = server.get(&format!("/v1/reconstructions/{id}/slices/axial/0.png")).send().await.unwrap();
    problem(response, 410, "source-removed").await;
    assert_eq!(server.get(&format!("/v1/reconstructions/{id}/cloud")).send().await.unwrap().status(), 200);
}

#[tokio::test]
async fn a_late_slice_leaves_the_old_cloud_served() {
    let server = Server::start().await;
    let (uid, old) = server.succeeded(1).await;
    server.upload("", slices(1, 11)[10].part10()).await;
    // A lone slice waits for more; here none comes.
    let complete = server.post(&format!("/v1/series/{uid}/complete")).send().await.unwrap();
    assert_eq!(complete.status(), 202);
    server.finish(&uid).await;
    let old: Value =
        server.get(&format!("/v1/reconstructions/{old}")).send().await.unwrap().json().await.unwrap();
    assert_eq!(old["state"], "superseded");
    let path = old["links"]["cloud"].as_str().expect("still served");
    assert_eq!(server.get(path).send().await.unwrap().status(), 200);
    let new = old["superseded_by"].as_str().unwrap();
    let series: Value = server.get(&format!("/v1/series/{uid}")).send().await.unwrap().json().await.unwrap();
    assert_eq!((series["revision"].as_u64(), series["reconstruction"]["id"].as_str()), (Some(2), Some(new)));
}
