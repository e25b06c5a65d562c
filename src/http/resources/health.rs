//! Whether the service lives, whether it can work, what it has counted, and what its API is.

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use axum::http::header::CONTENT_TYPE;
use axum::response::IntoResponse;
use serde::Serialize;

use crate::http::{Context, describe};
use crate::telemetry::Metrics;

/// The process lives.
#[derive(Debug, Serialize, utoipa::ToSchema)]
#[schema(example = json!({ "status": "alive", "software": "triplanar 0.1.0" }))]
pub(in crate::http) struct Alive {
    /// Always `alive`.
    status: &'static str,
    /// Name and version.
    software: &'static str,
}

/// Is the process alive?
///
/// Answers as long as the process does; it asks nothing of catalog, disk or queue, as `/readyz` does.
#[utoipa::path(
    get,
    path = "/healthz",
    operation_id = "health",
    tag = "Operation",
    responses((status = 200, description = "It is.", body = Alive)),
)]
pub(in crate::http) async fn alive() -> Json<Alive> {
    Json(Alive { status: "alive", software: crate::SOFTWARE })
}

/// Whether the service can take instances and make reconstructions.
#[derive(Debug, Serialize, utoipa::ToSchema)]
pub(in crate::http) struct Ready {
    /// Whether every dependency is.
    ready: bool,
    /// Each of them.
    dependencies: Vec<Dependency>,
}

/// Something that the service stands on.
#[derive(Debug, Serialize, utoipa::ToSchema)]
pub(in crate::http) struct Dependency {
    /// `catalog`, `data_dir` or `service`.
    name: &'static str,
    /// Whether it answers.
    ready: bool,
    /// What is wrong and what to do, if something is.
    detail: Option<String>,
}

/// Can the service work?
///
/// Asks each dependency: the catalog (a row is written, at most once in 5 s), the data directory
/// (writable, and with free space above the watermark), and the service itself (not shutting down).
#[utoipa::path(
    get,
    path = "/readyz",
    operation_id = "readiness",
    tag = "Operation",
    responses(
        (status = 200, description = "It can.", body = Ready),
        (status = 503, description = "It can't: see which dependency.", body = Ready),
    ),
)]
pub(in crate::http) async fn ready(State(context): State<Context>) -> (StatusCode, Json<Ready>) {
    let store = context.store.ready().await;
    let service =
        if context.shutdown.is_cancelled() { Err("the service is shutting down".to_owned()) } else { Ok(()) };
    let dependencies: Vec<_> =
        [("catalog", store.catalog), ("data_dir", store.data_dir), ("service", service)]
            .into_iter()
            .map(|(name, answer)| Dependency { name, ready: answer.is_ok(), detail: answer.err() })
            .collect();
    let ready = dependencies.iter().all(|dependency| dependency.ready);
    let status = if ready { StatusCode::OK } else { StatusCode::SERVICE_UNAVAILABLE };
    (status, Json(Ready { ready, dependencies }))
}

/// Metrics
///
/// In the OpenMetrics text format, for Prometheus.
#[utoipa::path(
    get,
    path = "/metrics",
    operation_id = "metrics",
    tag = "Operation",
    responses(
        (status = 200, description = "The metrics.", body = String, content_type = "application/openmetrics-text"),
    ),
)]
pub(in crate::http) async fn metrics(State(context): State<Context>) -> impl IntoResponse {
    if let Ok(bytes) = context.store.free_bytes() {
        context.metrics.set_free_disk_bytes(bytes);
    }
    context.metrics.set_store_counts(context.store.counts());
    if let Ok(changing) = context.store.identities_changing().await {
        context.metrics.set_identity_changing(changing);
    }
    if let Ok(queued) = context.store.queued().await {
        context.metrics.set_queue_depth(queued);
    }
    ([(CONTENT_TYPE, Metrics::MEDIA_TYPE)], context.metrics.encode())
}

/// This description
///
/// OpenAPI 3.1; `triplanar openapi` prints the same.
#[utoipa::path(
    get,
    path = "/openapi.json",
    operation_id = "openapi",
    tag = "Operation",
    responses((status = 200, description = "OpenAPI 3.1.", body = serde_json::Value)),
)]
pub(in crate::http) async fn openapi_document() -> Json<utoipa::openapi::OpenApi> {
    Json(describe::openapi())
}
