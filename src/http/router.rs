//! Routes and the layers around them.

use axum::Router;
use axum::http::header::{CONTENT_SECURITY_POLICY, REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS, X_FRAME_OPTIONS};
use axum::http::{HeaderName, HeaderValue};
use axum::middleware::from_fn_with_state;
use tokio_util::sync::CancellationToken;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::set_header::SetResponseHeaderLayer;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::resources::{
    clinical, cloud, events, health, pages, reconstructions, report, series, series_control, slices,
};
use super::{AppState, Context, auth, describe, host, observe, problem, query, stow, upload};
use crate::error::Error;

/// Pages get their own files and nothing else; nothing of ours belongs into a frame.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
                      connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'";

/// The operations that the API's description lists.
pub(super) fn operations() -> OpenApiRouter<Context> {
    OpenApiRouter::with_openapi(describe::head())
        .routes(routes!(upload::upload_series, series::list_series))
        .routes(routes!(series::get_series, series_control::delete_series))
        .routes(routes!(series_control::complete_series))
        .routes(routes!(series_control::expect_instances))
        .routes(routes!(clinical::choose_clinical))
        .routes(routes!(reconstructions::start_reconstruction))
        .routes(routes!(cloud::latest_cloud))
        .routes(routes!(report::latest_report))
        .routes(routes!(reconstructions::list_reconstructions))
        .routes(routes!(reconstructions::get_reconstruction, reconstructions::remove_reconstruction))
        .routes(routes!(events::reconstruction_events))
        .routes(routes!(cloud::reconstruction_cloud))
        .routes(routes!(report::reconstruction_report))
        .routes(routes!(slices::slice_picture))
        .routes(routes!(stow::store_instances))
        .routes(routes!(stow::store_instances_of_study))
        .routes(routes!(health::alive))
        .routes(routes!(health::ready))
        .routes(routes!(health::metrics))
        .routes(routes!(health::openapi_document))
}

/// All routes with their layers.
pub(super) fn router(state: AppState, shutdown: CancellationToken) -> Router {
    let context = Context::new(state, shutdown);
    let header = |name, value: &'static str| {
        SetResponseHeaderLayer::if_not_present(name, HeaderValue::from_static(value))
    };
    let same_origin = HeaderName::from_static("cross-origin-resource-policy");
    let (router, api) = operations().split_for_parts();
    router
        .route_layer(from_fn_with_state(query::Known::of(api), query::check))
        .merge(pages::routes())
        .fallback(nothing)
        .method_not_allowed_fallback(|| async { Error::MethodNotAllowed })
        // Layers run from the last to the first. `layer` wraps the fallbacks too.
        .layer(from_fn_with_state(context.clone(), auth::check))
        .layer(from_fn_with_state(context.clone(), host::check))
        .layer(CatchPanicLayer::custom(problem::of_panic))
        .layer(header(CONTENT_SECURITY_POLICY, POLICY))
        .layer(header(X_CONTENT_TYPE_OPTIONS, "nosniff"))
        .layer(header(X_FRAME_OPTIONS, "DENY"))
        .layer(header(REFERRER_POLICY, "no-referrer"))
        .layer(header(same_origin, "same-origin"))
        .layer(from_fn_with_state(context.clone(), observe::observe))
        .with_state(context)
}

async fn nothing() -> Error {
    Error::NoSuchPath
}
