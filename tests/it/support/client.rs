//! HTTP as a user of the service speaks it.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use reqwest::{Method, RequestBuilder, Response, StatusCode};
use serde_json::Value;

/// Far beyond what a small series takes.
const PATIENCE: Duration = Duration::from_secs(120);

/// A client of one service, with or without a token.
#[derive(Debug, Clone)]
pub(crate) struct Client {
    base: String,
    token: Option<String>,
    http: reqwest::Client,
}

impl Client {
    /// Of the service that listens there.
    pub(crate) fn new(address: SocketAddr) -> Self {
        Self { base: format!("http://{address}"), token: None, http: reqwest::Client::new() }
    }

    /// The same with a bearer token.
    pub(crate) fn with_token(&self, token: &str) -> Self {
        Self { token: Some(token.to_owned()), ..self.clone() }
    }

    /// A request to be completed.
    pub(crate) fn request(&self, method: Method, path: &str) -> RequestBuilder {
        let request = self.http.request(method, format!("{}{path}", self.base));
        match &self.token {
            Some(token) => request.bearer_auth(token),
            None => request,
        }
    }

    /// `GET`.
    pub(crate) async fn get(&self, path: &str) -> Response {
        self.request(Method::GET, path).send().await.expect("the service answers")
    }

    /// `GET` of JSON that must be there.
    pub(crate) async fn json(&self, path: &str) -> Value {
        let response = self.get(path).await;
        let status = response.status();
        let body = response.text().await.expect("a body");
        assert_eq!(status, StatusCode::OK, "GET {path}: {body}");
        serde_json::from_str(&body).unwrap_or_else(|error| panic!("GET {path}: {error}: {body}"))
    }

    /// `GET` of bytes that must be there.
    pub(crate) async fn bytes(&self, path: &str) -> Vec<u8> {
        let response = self.get(path).await;
        let status = response.status();
        let body = response.bytes().await.expect("a body").to_vec();
        assert_eq!(status, StatusCode::OK, "GET {path}: {}", String::from_utf8_lossy(&body));
        body
    }

    /// `POST` of JSON: status and body.
    pub(crate) async fn post(&self, path: &str, body: &Value) -> (StatusCode, Value) {
        answer(self.request(Method::POST, path).json(body)).await
    }

    /// `POST /v1/series` of one body: status and answer.
    pub(crate) async fn upload(&self, media_type: &str, body: Vec<u8>) -> (StatusCode, Value) {
        answer(self.request(Method::POST, "/v1/series").header("content-type", media_type).body(body)).await
    }

    /// The reconstructions of a series, oldest first.
    pub(crate) async fn reconstructions(&self, series: &str) -> Vec<Value> {
        let page = self.json(&format!("/v1/reconstructions?series={series}")).await;
        let mut rows = page["items"].as_array().expect("a page has items").clone();
        rows.reverse();
        rows
    }

    /// Waits until the series has `count` reconstructions, all of them in a final state.
    pub(crate) async fn settled(&self, series: &str, count: usize) -> Vec<Value> {
        let is_final = |row: &Value| !matches!(row["state"].as_str(), Some("queued" | "running"));
        let begin = Instant::now();
        loop {
            let rows = self.reconstructions(series).await;
            if rows.len() >= count && rows.iter().all(is_final) {
                return rows;
            }
            assert!(begin.elapsed() < PATIENCE, "series {series} is not settled: {rows:#?}");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }
}

/// Status and JSON body of an answer.
pub(crate) async fn answer(request: RequestBuilder) -> (StatusCode, Value) {
    let response = request.send().await.expect("the service answers");
    let status = response.status();
    let text = response.text().await.expect("a body");
    (status, serde_json::from_str(&text).unwrap_or(Value::String(text)))
}
