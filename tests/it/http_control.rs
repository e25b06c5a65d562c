//! Series and reconstructions: listed, completed, reconstructed again, removed; and what is asked
//! wrongly.

use reqwest::Method;
use serde_json::{Value, json};

use crate::support::http::{Server, problem, slices, zip_of};

async fn json_of(server: &Server, path: &str) -> Value {
    let response = server.get(path).send().await.unwrap();
    assert_eq!(response.status(), 200, "{path}");
    response.json().await.unwrap()
}

#[tokio::test]
async fn series_are_found_by_patient_and_study_and_listed_in_pages() {
    let server = Server::start().await;
    for series in 1..=5 {
        server.upload("", zip_of(series, 3)).await;
    }
    let mut seen = Vec::new();
    let mut next = Some(String::new());
    while let Some(cursor) = next {
        let page = json_of(&server, &format!("/v1/series?limit=2{cursor}")).await;
        seen.extend(
            page["items"]
                .as_array()
                .unwrap()
                .iter()
                .map(|s| s["series_instance_uid"].as_str().unwrap().to_owned()),
        );
        next = page["next_cursor"].as_str().map(|cursor| format!("&cursor={cursor}"));
    }
    let newest_first: Vec<_> =
        (1..=5).rev().map(|series| slices(series, 1)[0].series_uid().to_string()).collect();
    assert_eq!(seen, newest_first);
    for (query, found) in [
        ("PatientID=PATIENT-4711", 5),
        ("PatientID=PATIENT-4712", 0),
        ("PatientID=PATIENT-471%25", 0),
        ("StudyInstanceUID=1.2.826.0.1.3680043.10.9999.7.1&state=complete", 5),
        ("state=receiving", 0),
        ("AccessionNumber=A%00b", 0),
    ] {
        let page = json_of(&server, &format!("/v1/series?{query}")).await;
        assert_eq!(page["items"].as_array().unwrap().len(), found, "{query}");
    }
    let reconstructions = json_of(&server, "/v1/reconstructions?state=queued&limit=200").await;
    assert_eq!(reconstructions["items"].as_array().unwrap().len(), 5);
}

#[tokio::test]
async fn a_series_is_complete_when_somebody_says_so() {
    let server = Server::start().await;
    server.upload("?expect=9", zip_of(1, 3)).await;
    let path = format!("/v1/series/{}", slices(1, 1)[0].series_uid());
    assert_eq!(json_of(&server, &path).await["state"], "receiving");
    for _ in 0..2 {
        let response = server.post(&format!("{path}/complete")).send().await.unwrap();
        assert_eq!(response.status(), 202);
        let told: Value = response.json().await.unwrap();
        assert_eq!(told["series"]["complete_reason"], "explicit");
        assert_eq!(told["reconstruction"]["state"], "queued");
    }
    problem(server.post("/v1/series/1.2.3/complete").send().await.unwrap(), 404, "not-found").await;
}

#[tokio::test]
async fn the_expected_number_may_be_said_before_the_first_instance() {
    let server = Server::start().await;
    let path = format!("/v1/series/{}", slices(1, 1)[0].series_uid());
    let put =
        |body: Value| server.request(Method::PUT, &format!("{path}/expected-instances")).json(&body).send();
    let response = put(json!({ "instances": 4 })).await.unwrap();
    assert_eq!(response.json::<Value>().await.unwrap(), json!({ "instances": 4 }));
    server.upload("", zip_of(1, 3)).await;
    assert_eq!(json_of(&server, &path).await["state"], "receiving");
    server.upload("", slices(1, 4)[3].part10()).await;
    assert_eq!(json_of(&server, &path).await["complete_reason"], "expected_instances");
    for wrong in
        [json!({ "instances": 0 }), json!({}), json!([4]), json!({ "instances": 4, "x": 1 }), json!(null)]
    {
        problem(put(wrong).await.unwrap(), 422, "invalid-body").await;
    }
}

#[tokio::test]
async fn the_same_parameters_are_the_same_reconstruction() {
    let server = Server::start().await;
    let (uid, first) = server.queued(1).await;
    let path = format!("/v1/series/{uid}/reconstructions");
    let ask = |body: Option<Value>| async {
        let request = server.post(&path);
        let request = if let Some(body) = body { request.json(&body) } else { request };
        let response = request.send().await.unwrap();
        assert_eq!(response.status(), 202);
        let location = response.headers()["location"].to_str().unwrap().to_owned();
        let told: Value = response.json().await.unwrap();
        assert_eq!(location, format!("/v1/reconstructions/{}", told["id"].as_str().unwrap()));
        told
    };
    assert_eq!(ask(None).await["id"], first.to_string());
    assert_eq!(ask(Some(json!({ "leaf_mm": 1.0 }))).await["id"], first.to_string());
    let fine = json!({ "profile": "paper", "leaf_mm": 0.38, "radius_outlier": { "min_neighbours": 7 } });
    let fine = ask(Some(fine)).await;
    assert_ne!(fine["id"], first.to_string());
    assert_eq!(fine["parameters"]["radius_outlier"], json!({ "radius_mm": 10.0, "min_neighbours": 7 }));
    assert_eq!(
        ask(Some(json!({ "radius_outlier": { "min_neighbours": 7 }, "leaf_mm": 0.38, "profile": "paper" })))
            .await["id"],
        fine["id"]
    );

    let post = |body: &'static str, media_type: &'static str| {
        server.post(&path).header("content-type", media_type).body(body).send()
    };
    for wrong in [
        "{\"leaf_mm\": 0}",
        "{\"leaf\": 1}",
        "[]",
        "{",
        "{\"radius_outlier\": [5, 3]}",
        "{\"leaf_mm\": null}",
        // Of two values neither is the one that was meant.
        "{\"leaf_mm\": 2, \"leaf_mm\": 3}",
        "{\"radius_outlier\": {\"min_neighbours\": 7, \"min_neighbours\": 8}}",
        // Without effect under the profile that runs.
        "{\"profile\": \"precise\", \"hu_min\": -300}",
        "{\"profile\": \"paper\", \"quality\": {\"noise_hu\": 60}}",
    ] {
        problem(post(wrong, "application/json").await.unwrap(), 422, "invalid-body").await;
    }
    problem(post("{}", "text/plain").await.unwrap(), 415, "unsupported-media-type").await;
    let large = server.post(&path).header("content-type", "application/json").body(vec![b' '; 70_000]);
    problem(large.send().await.unwrap(), 413, "too-large").await;
    problem(server.post("/v1/series/1.2.3/reconstructions").send().await.unwrap(), 404, "not-found").await;
}

#[tokio::test]
async fn removing_cancels_what_waits_and_deletes_what_has_ended() {
    let server = Server::start().await;
    let (uid, id) = server.queued(1).await;
    let path = format!("/v1/reconstructions/{id}");
    let delete = |path: String| server.request(Method::DELETE, &path).send();
    let cancelled = delete(path.clone()).await.unwrap();
    assert_eq!(cancelled.status(), 202);
    assert_eq!(cancelled.json::<Value>().await.unwrap()["state"], "cancelled");
    assert_eq!(delete(path.clone()).await.unwrap().status(), 204);
    problem(delete(path.clone()).await.unwrap(), 404, "not-found").await;
    problem(server.get(&path).send().await.unwrap(), 404, "not-found").await;

    let series = format!("/v1/series/{uid}");
    assert_eq!(delete(series.clone()).await.unwrap().status(), 204);
    problem(delete(series.clone()).await.unwrap(), 404, "not-found").await;
    problem(server.get(&series).send().await.unwrap(), 404, "not-found").await;
}

#[tokio::test]
async fn whatever_is_asked_wrongly_is_told_as_a_problem() {
    let server = Server::start().await;
    for (path, status, code) in [
        ("/nothing", 404, "not-found"),
        ("/v1/series/1.2.3", 404, "not-found"),
        ("/v1/series/01a20209-e478-722b-88d2-be86ff8bf75c", 400, "invalid-parameter"),
        ("/v1/series/1..2", 400, "invalid-parameter"),
        ("/v1/series/%00", 400, "invalid-parameter"),
        ("/v1/series/%ff", 400, "invalid-parameter"),
        ("/v1/series/%F0%9F%A7%A0", 400, "invalid-parameter"),
        ("/v1/reconstructions/1.2.3", 400, "invalid-parameter"),
        ("/v1/reconstructions/00000000-0000-0000-0000-000000000000", 404, "not-found"),
        ("/v1/series?limit=0", 400, "invalid-parameter"),
        ("/v1/series?limit=201", 400, "invalid-parameter"),
        ("/v1/series?limit=x", 400, "invalid-parameter"),
        ("/v1/series?limit=1&limit=2", 400, "invalid-parameter"),
        ("/v1/series?cursor=made-up", 400, "invalid-parameter"),
        ("/v1/series?state=lost", 400, "invalid-parameter"),
        ("/v1/series?patientid=x", 400, "invalid-parameter"),
        ("/v1/reconstructions?series=x", 400, "invalid-parameter"),
    ] {
        problem(server.get(path).send().await.unwrap(), status, code).await;
    }
    let long = format!("/v1/series?PatientID={}", "x".repeat(65));
    problem(server.get(&long).send().await.unwrap(), 400, "invalid-parameter").await;
    for (method, path, allowed) in [
        ("PATCH", "/v1/series", "GET"),
        ("DELETE", "/v1/series", "POST"),
        ("POST", "/v1/reconstructions", "GET"),
        ("OPTIONS", "/healthz", "GET"),
        ("BREW", "/metrics", "GET"),
        ("GET", "/dicom-web/studies", "POST"),
    ] {
        let method = Method::from_bytes(method.as_bytes()).unwrap();
        let response = server.request(method, path).send().await.unwrap();
        let allow = response.headers()["allow"].to_str().unwrap().to_owned();
        assert!(allow.contains(allowed), "{path}: {allow}");
        problem(response, 405, "method-not-allowed").await;
    }
}

#[tokio::test]
async fn health_readiness_and_metrics_are_told() {
    let server = Server::start().await;
    server.upload("", zip_of(1, 3)).await;
    assert_eq!(json_of(&server, "/healthz").await["status"], "alive");
    let ready = json_of(&server, "/readyz").await;
    let names: Vec<_> =
        ready["dependencies"].as_array().unwrap().iter().map(|d| d["name"].as_str().unwrap()).collect();
    assert_eq!((ready["ready"].as_bool(), names), (Some(true), vec!["catalog", "data_dir", "service"]));
    server.get("/v1/series/1.2.3").send().await.unwrap();
    let metrics = server.get("/metrics").send().await.unwrap();
    assert!(metrics.headers()["content-type"].to_str().unwrap().starts_with("application/openmetrics-text"));
    let text = metrics.text().await.unwrap();
    for line in [
        "triplanar_instances_total{sender=\"upload\",outcome=\"stored\"} 3",
        "triplanar_http_requests_total{method=\"GET\",route=\"/v1/series/{series}\",status=\"404\"} 1",
    ] {
        assert!(text.lines().any(|l| l == line), "{line} is missing in\n{text}");
    }
    assert!(!text.contains("4711") && !text.contains("1.2.3"), "metrics name neither patients nor paths");
}

#[tokio::test]
async fn no_operation_takes_a_parameter_that_it_does_not_describe() {
    let server = Server::start().await;
    let api = json_of(&server, "/openapi.json").await;
    let uid = slices(1, 1)[0].series_uid().to_string();
    let id = "019aa7a0-6f3c-7c1e-9d59-0d1c3a1d1c55";
    let mut asked = 0;
    for (path, item) in api["paths"].as_object().unwrap().iter().filter(|(path, _)| path.starts_with("/v1/"))
    {
        let path = path.replace("{series}", &uid).replace("{id}", id);
        let path = path.replace("{plane}", "axial").replace("{picture}", "0.png");
        for method in
            item.as_object().unwrap().keys().filter(|key| ["get", "post", "put", "delete"].contains(&&***key))
        {
            let method = Method::from_bytes(method.to_uppercase().as_bytes()).unwrap();
            let response = server.request(method, &format!("{path}?expct=500")).send().await.unwrap();
            let told = problem(response, 400, "invalid-parameter").await;
            assert!(told["detail"].as_str().unwrap().contains("`expct`"), "{path}: {told}");
            asked += 1;
        }
    }
    assert!(asked >= 16, "{asked}");
}
