//! Every request gets an id, a line in the log and its place in the metrics. Neither holds the
//! path or the query, which may name a patient: the route's template stands for them.

use std::time::Instant;

use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderName, HeaderValue, Method};
use axum::middleware::Next;
use axum::response::Response;
use tracing::Instrument;
use uuid::Uuid;

use super::Context;

/// The header that tells a request's id.
pub const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// The label of a request that no route matched.
const NO_ROUTE: &str = "none";

tokio::task_local! {
    static CURRENT: RequestId;
}

/// The id of one request: in the log, in `X-Request-Id`, and as `instance` of a problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct RequestId(Uuid);

impl RequestId {
    /// The id of the request that this task answers, if it answers one.
    #[must_use]
    pub(super) fn current() -> Option<Self> {
        CURRENT.try_with(|id| *id).ok()
    }

    /// `urn:uuid:…`.
    #[must_use]
    pub(super) fn urn(self) -> String {
        self.0.urn().to_string()
    }
}

/// Who sent a request: the name of its token, put into the answer by the check of access.
#[derive(Debug, Clone)]
pub(super) struct Caller(pub(super) String);

/// The outermost layer.
pub(super) async fn observe(State(state): State<Context>, request: Request, next: Next) -> Response {
    let begun = Instant::now();
    let id = RequestId(Uuid::now_v7());
    let method = label(request.method());
    let route = request.extensions().get::<MatchedPath>().map_or(NO_ROUTE, MatchedPath::as_str).to_owned();
    let span = tracing::info_span!("request", id = %id.0, method, route);
    let answer = async {
        let mut response = CURRENT.scope(id, next.run(request)).await;
        let took = begun.elapsed();
        let status = response.status().as_u16();
        state.metrics.http_request(method, &route, status, took);
        let caller = response.extensions().get::<Caller>().map(|caller| caller.0.as_str());
        tracing::info!(status, caller, milliseconds = took.as_millis(), "answered");
        if let Ok(value) = HeaderValue::from_str(&id.0.to_string()) {
            response.headers_mut().insert(REQUEST_ID, value);
        }
        response
    };
    answer.instrument(span).await
}

/// A client can make up methods; the metrics' labels must stay few.
fn label(method: &Method) -> &'static str {
    match method.as_str() {
        "GET" => "GET",
        "HEAD" => "HEAD",
        "POST" => "POST",
        "PUT" => "PUT",
        "DELETE" => "DELETE",
        "PATCH" => "PATCH",
        "OPTIONS" => "OPTIONS",
        _ => "other",
    }
}
