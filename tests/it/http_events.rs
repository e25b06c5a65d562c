//! Server-sent events.

use serde_json::Value;

use crate::support::http::{Server, problem};

/// Event names and data of a stream that has ended.
fn events(text: &str) -> Vec<(String, Value)> {
    text.split("\n\n")
        .filter_map(|block| {
            let field = |name: &str| block.lines().find_map(|line| line.strip_prefix(name));
            Some((field("event: ")?.to_owned(), serde_json::from_str(field("data: ")?).expect("JSON")))
        })
        .collect()
}

#[tokio::test]
async fn a_watcher_hears_every_stage_and_then_the_result() {
    let server = Server::start().await;
    let (_, id) = server.queued(1).await;
    let watching = server.get(&format!("/v1/reconstructions/{id}/events")).send().await.unwrap();
    assert_eq!(watching.headers()["content-type"], "text/event-stream");
    server.work();
    let heard = events(&watching.text().await.unwrap());
    let (last, before) = heard.split_last().expect("events");
    assert_eq!(before[0].1["state"], "queued");
    assert!(before.iter().all(|(name, data)| name == "progress" && data["id"] == id.to_string()));
    assert!(before.iter().any(|(_, data)| data["state"] == "running"), "{before:?}");
    // A series of grey squares has no skin.
    assert_eq!((last.0.as_str(), last.1["state"].as_str()), ("result", Some("failed")));
    assert_eq!(last.1["error"]["code"], "empty_cloud");
    assert_eq!((&last.1["stage"], last.1["fraction"].as_f64()), (&Value::Null, Some(0.0)));

    // Who comes late hears the result alone.
    let late = server.get(&format!("/v1/reconstructions/{id}/events")).send().await.unwrap();
    assert_eq!(events(&late.text().await.unwrap()), std::slice::from_ref(last));
    let none =
        server.get("/v1/reconstructions/01a20209-e478-722b-88d2-be86ff8bf75c/events").send().await.unwrap();
    problem(none, 404, "not-found").await;
}

#[tokio::test]
async fn streams_end_when_the_service_stops() {
    let mut server = Server::start().await;
    let (_, id) = server.queued(1).await;
    let watching = server.get(&format!("/v1/reconstructions/{id}/events")).send().await.unwrap();
    server.shutdown.cancel();
    let heard = events(&watching.text().await.expect("it ends in good order"));
    assert!(heard.iter().all(|(name, _)| name == "progress"));
    (&mut server.served).await.expect("the server ends");
}
