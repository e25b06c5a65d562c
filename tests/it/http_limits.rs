//! Connections, uploads and bodies have limits, and who meets one is told.

use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::support::http::{Server, problem, zip_of};
use crate::support::raw::exchange;

async fn raw(server: &Server, bytes: &[u8]) -> String {
    exchange(server.address, bytes).await
}

#[tokio::test]
async fn one_upload_more_than_allowed_is_told_to_come_back() {
    let server = Server::with(|config| config.http.max_uploads = 1).await;
    let (slow, response) = server.filled_by_an_upload().await;
    assert!(response.headers().contains_key("retry-after"));
    problem(response, 503, "busy").await;
    drop(slow);
    // The place is free again as soon as the server has seen that.
    server.room_for_an_upload().await;
    server.upload("", zip_of(1, 3)).await;
}

#[tokio::test]
async fn a_head_or_a_body_that_does_not_come_ends_the_connection() {
    let server = Server::with(|config| config.http.idle_timeout = Duration::from_millis(300)).await;
    assert_eq!(raw(&server, b"GET /healthz HTTP/1.1\r\nhost: localhost\r\nx-slow: ").await, "");
    assert_eq!(raw(&server, b"").await, "");
    for path in ["/v1/series", "/dicom-web/studies", "/v1/series/1.2/reconstructions"] {
        let head = format!(
            "POST {path} HTTP/1.1\r\nhost: localhost\r\ncontent-type: {}\r\ncontent-length: 100\r\n\r\nabc",
            if path == "/dicom-web/studies" { "application/dicom" } else { "application/json" }
        );
        let head = if path == "/v1/series" { head.replace("json", "zip") } else { head };
        let answer = raw(&server, head.as_bytes()).await;
        assert!(answer.starts_with("HTTP/1.1 408 "), "{path}: {answer}");
        assert!(answer.contains("urn:triplanar:problem:request-timeout"), "{path}: {answer}");
    }
}

#[tokio::test]
async fn a_body_that_breaks_off_stores_nothing() {
    let server = Server::start().await;
    let archive = zip_of(1, 3);
    let mut stream = TcpStream::connect(server.address).await.unwrap();
    let head = format!(
        "POST /v1/series HTTP/1.1\r\nhost: localhost\r\ncontent-length: {}\r\n\r\n",
        archive.len() + 1
    );
    stream.write_all(head.as_bytes()).await.unwrap();
    stream.write_all(&archive).await.unwrap();
    drop(stream);
    // A request after it is answered while nothing of the first is there.
    let listed: serde_json::Value = server.get("/v1/series").send().await.unwrap().json().await.unwrap();
    assert_eq!(listed["items"].as_array().unwrap().len(), 0);
}

#[tokio::test]
async fn a_stop_lets_a_request_that_runs_end() {
    let mut server = Server::start().await;
    let archive = zip_of(1, 3);
    let mut stream = TcpStream::connect(server.address).await.unwrap();
    let head =
        format!("POST /v1/series HTTP/1.1\r\nhost: localhost\r\ncontent-length: {}\r\n\r\n", archive.len());
    stream.write_all(head.as_bytes()).await.unwrap();
    let (first, rest) = archive.split_at(archive.len() / 2);
    stream.write_all(first).await.unwrap();
    // The request has arrived when its upload takes the only place… which a second one shows; here
    // it is enough that its first half was read: the server accepts before it stops.
    server.get("/healthz").send().await.unwrap();
    server.shutdown.cancel();
    stream.write_all(rest).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 202 "), "{answer}");
    (&mut server.served).await.expect("the server ends");
    assert!(TcpStream::connect(server.address).await.is_err(), "nobody listens any more");
}
