//! The cloud of a series is the clinical one, and every result says what it is of.

use std::time::Duration;

use reqwest::{Method, Response};
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use triplanar::config::{Role, Token};
use triplanar::dicom::uid::SeriesInstanceUid;
use triplanar::store::{Fault, Outcome, ReconstructionId, SenderEnd};
use uuid::Uuid;

use crate::support::http::{Server, problem, slices};

fn header(response: &Response, name: &str) -> Option<String> {
    response.headers().get(name).map(|value| value.to_str().unwrap().to_owned())
}

/// The reconstruction whose cloud is served for the series: its file is named after it.
async fn served(server: &Server, uid: &SeriesInstanceUid) -> String {
    let response = server.get(&format!("/v1/series/{uid}/cloud")).send().await.unwrap();
    assert_eq!(response.status(), 200);
    let name = header(&response, "content-disposition").expect("a file name");
    let id = header(&response, "triplanar-reconstruction").expect("an id");
    assert!(name.contains(&format!("triplanar-{id}.ply")), "{name}");
    let location = header(&response, "content-location").expect("a location");
    assert_eq!(location, format!("/v1/reconstructions/{id}/cloud?format=ply_binary"));
    let report = server.get(&format!("/v1/series/{uid}/report")).send().await.unwrap();
    assert_eq!(header(&report, "triplanar-reconstruction"), Some(id.clone()), "the report is of the same");
    let (there, here) = (server.get(&location).send().await.unwrap(), response.bytes().await.unwrap());
    assert_eq!(there.bytes().await.unwrap(), here);
    id
}

/// Somebody's experiment on the series, finished.
async fn experiment(server: &Server, uid: &SeriesInstanceUid, leaf_mm: f64) -> ReconstructionId {
    let path = format!("/v1/series/{uid}/reconstructions");
    let told: Value =
        server.post(&path).json(&json!({ "leaf_mm": leaf_mm })).send().await.unwrap().json().await.unwrap();
    server.finish(uid).await;
    told["id"].as_str().unwrap().parse().unwrap()
}

async fn choose(server: &Server, uid: &SeriesInstanceUid, id: Value) -> Response {
    let path = format!("/v1/series/{uid}/clinical-reconstruction");
    server.request(Method::PUT, &path).json(&json!({ "id": id })).send().await.unwrap()
}

async fn complete(server: &Server, uid: &SeriesInstanceUid) {
    let done = server.post(&format!("/v1/series/{uid}/complete")).send().await.unwrap();
    assert_eq!(done.status(), 202);
}

#[tokio::test]
async fn an_experiment_is_not_served_until_an_operator_chooses_it() {
    let server = Server::start().await;
    let (uid, own) = server.succeeded(1).await;
    let other = experiment(&server, &uid, 2.0).await;
    assert_eq!(served(&server, &uid).await, own.to_string());

    let told: Value = choose(&server, &uid, json!(other.to_string())).await.json().await.unwrap();
    assert_eq!((&told["reconstruction"], &told["chosen"]), (&json!(other.to_string()), &json!(true)));
    assert_eq!(served(&server, &uid).await, other.to_string());
    // One that was made later changes nothing.
    experiment(&server, &uid, 3.0).await;
    assert_eq!(served(&server, &uid).await, other.to_string());
    // Removed, it gives its place back.
    let path = format!("/v1/reconstructions/{other}");
    assert_eq!(server.request(Method::DELETE, &path).send().await.unwrap().status(), 204);
    assert_eq!(served(&server, &uid).await, own.to_string());

    let other = experiment(&server, &uid, 4.0).await;
    choose(&server, &uid, json!(other.to_string())).await;
    choose(&server, &uid, Value::Null).await;
    assert_eq!(served(&server, &uid).await, own.to_string());
    let series: Value = server.get(&format!("/v1/series/{uid}")).send().await.unwrap().json().await.unwrap();
    assert_eq!(series["clinical"]["reconstruction"], json!(own.to_string()));
    let choices = series["clinical"]["choices"].as_array().unwrap();
    assert_eq!(choices.len(), 3, "{choices:#?}");
    assert_eq!(choices[1]["reconstruction"], json!(other.to_string()));
    assert!(choices.iter().all(|choice| choice["revision"] == 1 && choice["chosen"].is_string()));
}

#[tokio::test]
async fn a_choice_that_can_not_be_is_refused() {
    let server = Server::start().await;
    let (uid, _) = server.succeeded(1).await;
    let (_, foreign) = server.succeeded(2).await;
    let (waiting_of, waiting) = server.queued(3).await;
    problem(choose(&server, &uid, json!(foreign.to_string())).await, 404, "not-found").await;
    problem(choose(&server, &uid, json!(Uuid::new_v4().to_string())).await, 404, "not-found").await;
    problem(choose(&server, &uid, json!("own")).await, 422, "invalid-body").await;
    problem(choose(&server, &"1.2.3.4".parse().unwrap(), Value::Null).await, 404, "not-found").await;
    let waits = choose(&server, &waiting_of, json!(waiting.to_string())).await;
    problem(waits, 409, "reconstruction-state").await;
    let path = format!("/v1/series/{uid}/clinical-reconstruction");
    let nothing = server.request(Method::PUT, &path).json(&json!({})).send().await.unwrap();
    problem(nothing, 422, "invalid-body").await;
}

#[tokio::test]
async fn operators_alone_choose_and_stand_in_the_record() {
    let sha256 = |token: &str| hex::encode(Sha256::digest(token.as_bytes()));
    let token = |name: &str, role| Token { name: name.to_owned(), role, sha256: sha256(name) };
    let server = Server::with(|config| {
        config.http.tokens = vec![
            token("surgeon", Role::Read),
            token("pacs", Role::Upload),
            token("physicist", Role::Operate),
        ];
    })
    .await;
    let body = slices(1, 3);
    let path = format!("/v1/series/{}/clinical-reconstruction", body[0].series_uid());
    let put =
        |name: &str| server.request(Method::PUT, &path).bearer_auth(name).json(&json!({ "id": null })).send();
    for name in ["surgeon", "pacs"] {
        problem(put(name).await.unwrap(), 403, "forbidden").await;
    }
    let sent = server.post("/v1/series").bearer_auth("pacs").body(body[0].part10()).send().await.unwrap();
    assert_eq!(sent.status(), 202);
    let told: Value = put("physicist").await.unwrap().json().await.unwrap();
    assert_eq!(told["choices"][0]["chosen_by"], "physicist", "{told:#}");
}

#[tokio::test]
async fn a_newer_revision_at_work_or_failed_is_told_and_can_be_waited_for() {
    let server = Server::start().await;
    let (uid, old) = server.succeeded(1).await;
    let path = format!("/v1/series/{uid}/cloud");
    let current = format!("{path}?revision=current");
    let newer = async || {
        let response = server.get(&path).send().await.unwrap();
        assert_eq!(header(&response, "triplanar-reconstruction"), Some(old.to_string()));
        (header(&response, "triplanar-newer-revision"), header(&response, "link"))
    };
    let waits = async |state: &str| {
        for path in [&current, &format!("/v1/series/{uid}/report?revision=current")] {
            let response = server.get(path).send().await.unwrap();
            let after = header(&response, "retry-after").expect("when to ask again");
            assert!(after.parse::<u32>().is_ok_and(|after| after > 0), "{after}");
            let told = problem(response, 409, "not-current").await;
            assert!(told["detail"].as_str().unwrap().contains(state), "{told:#}");
        }
    };
    assert_eq!(newer().await, (None, None));
    assert_eq!(server.get(&current).send().await.unwrap().status(), 200);

    server.upload("", slices(1, 11)[10].part10()).await;
    let series = format!("</v1/series/{uid}>; rel=\"latest-version\"");
    assert_eq!(newer().await, (Some("2; state=receiving".to_owned()), Some(series)));
    waits("receiving").await;

    complete(&server, &uid).await;
    let claim = server.store.claim("w", Duration::from_secs(60)).await.unwrap().unwrap();
    let id = claim.lease.id;
    let link = Some(format!("</v1/reconstructions/{id}>; rel=\"latest-version\""));
    assert_eq!(newer().await, (Some(format!("2; state=running; reconstruction={id}")), link.clone()));
    waits("running").await;

    let fault = Fault { code: "missing_slice".into(), detail: "one".into(), instances: Vec::new() };
    assert!(server.store.finish_failure(&claim.lease, &fault, None).await.unwrap());
    assert_eq!(newer().await, (Some(format!("2; state=failed; reconstruction={id}")), link));
    waits("failed").await;
    let wrong = server.get(&format!("{path}?revision=1")).send().await.unwrap();
    problem(wrong, 400, "invalid-parameter").await;

    // Started again, and now it succeeds: an operator's choice of the first revision is over too.
    choose(&server, &uid, json!(old.to_string())).await;
    assert_eq!(served(&server, &uid).await, old.to_string(), "it is what the operator wants");
    waits("failed").await;
    assert_eq!(newer().await.0, Some(format!("2; state=failed; reconstruction={id}")));
    let again = server.post(&format!("/v1/series/{uid}/reconstructions")).send().await.unwrap();
    assert_eq!(again.status(), 202);
    server.finish(&uid).await;
    choose(&server, &uid, Value::Null).await;
    assert_eq!(served(&server, &uid).await, id.to_string());
    assert_eq!(server.get(&current).send().await.unwrap().status(), 200);
    // Chosen although the latest revision has its own: what is served is not of the latest.
    choose(&server, &uid, json!(old.to_string())).await;
    waits("succeeded").await;
    assert_eq!(newer().await.0, Some(format!("2; state=succeeded; reconstruction={id}")));
    choose(&server, &uid, Value::Null).await;
    assert_eq!(server.get(&current).send().await.unwrap().status(), 200);
    let by_id = server.get(&format!("/v1/reconstructions/{old}/cloud")).send().await.unwrap();
    let told = header(&by_id, "triplanar-newer-revision").expect("a superseded one says so");
    assert_eq!(told, format!("2; state=succeeded; reconstruction={id}"));
    assert_eq!(header(&by_id, "triplanar-revision").as_deref(), Some("1"));
}

#[tokio::test]
async fn a_choice_ends_with_the_next_revision() {
    let server = Server::start().await;
    let (uid, _) = server.succeeded(1).await;
    let other = experiment(&server, &uid, 2.0).await;
    choose(&server, &uid, json!(other.to_string())).await;
    server.upload("", slices(1, 11)[10].part10()).await;
    complete(&server, &uid).await;
    assert_eq!(served(&server, &uid).await, other.to_string(), "until the new one is there");
    server.finish(&uid).await;
    let new = served(&server, &uid).await;
    assert_ne!(new, other.to_string());
    let series: Value = server.get(&format!("/v1/series/{uid}")).send().await.unwrap().json().await.unwrap();
    assert_eq!((&series["clinical"]["chosen"], &series["revision"]), (&json!(false), &json!(2)));
}

#[tokio::test]
async fn verdict_and_doubts_of_result_and_transfer_stand_in_the_headers() {
    let server = Server::start().await;
    let (uid, id) = server.queued(1).await;
    let claim = server.store.claim("w", Duration::from_secs(60)).await.unwrap().unwrap();
    let quality = json!({
        "verdict": "limited", "doubts": ["cut_below", "thick_slices"], "coverage": 0.9, "missing": [],
        "agreement_mean_mm": 0.1, "agreement_p95_mm": 0.2, "sides": [], "noise_hu": 7.0, "clipped_air": false,
        "edge_in_plane_mm": 0.4, "edge_across_mm": 0.4, "slice_mm": 3.0, "motion_mm": 0.1, "cut_above_cm2": 0.0,
        "cut_below_cm2": 9.0, "cut_at_side_cm2": 0.0, "metal_cm3": 0.0,
    });
    let outcome = Outcome {
        quality: Some(serde_json::from_value(quality).unwrap()),
        ..crate::support::entrance::outcome("x")
    };
    assert!(server.store.finish_success(&claim.lease, &outcome).await.unwrap());
    let path = format!("/v1/series/{uid}/cloud");
    let told = async || {
        let answer = server.get(&path).send().await.unwrap();
        let again = server.get(&path).header("if-none-match", header(&answer, "etag").unwrap());
        let again = again.send().await.unwrap();
        assert_eq!(again.status(), 304);
        for name in ["triplanar-verdict", "triplanar-doubts", "content-location"] {
            assert_eq!(header(&again, name), header(&answer, name), "{name} of the 304");
        }
        assert_eq!(header(&answer, "triplanar-reconstruction"), Some(id.to_string()));
        assert_eq!(header(&answer, "triplanar-algorithm").as_deref(), Some("paper/1"));
        (header(&answer, "triplanar-verdict").unwrap(), header(&answer, "triplanar-doubts").unwrap())
    };
    assert_eq!(told().await, ("limited".to_owned(), "cut_below, thick_slices".to_owned()));
    // The same instance again, by a sender that breaks off.
    let sender = Uuid::new_v4();
    let spool = {
        let mut spool = server.intake.begin().await.unwrap();
        spool.write(&slices(1, 1)[0].part10()).await.unwrap();
        spool
    };
    let announced = triplanar::intake::Announced {
        encoding: triplanar::intake::Encoding::Part10,
        sop_class_uid: None,
        sop_instance_uid: None,
        study_instance_uid: None,
        sender: triplanar::intake::Sender::Upload { id: sender },
    };
    server.intake.store(spool, announced).await.unwrap();
    server.intake.sender_ended(sender, SenderEnd::UploadBroken).await.unwrap();
    assert_eq!(told().await.1, "cut_below, thick_slices, incomplete_transfer");
    complete(&server, &uid).await;
    assert_eq!(told().await.1, "cut_below, thick_slices");
}
