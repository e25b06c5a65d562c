//! The pages for people, served from the binary alone: no other host, no data in them.

use axum::Router;
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE};
use axum::http::{HeaderValue, Uri};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::get;

use crate::error::{Error, Result};
use crate::http::Context;

const HOME: &str = include_str!("../pages/home.html");
const DOCS: &str = include_str!("../pages/docs.html");

/// Name, media type and text of what the pages load.
const ASSETS: [(&str, &str, &str); 4] = [
    ("page.css", "text/css; charset=utf-8", include_str!("../pages/page.css")),
    ("session.js", "text/javascript; charset=utf-8", include_str!("../pages/session.js")),
    ("home.js", "text/javascript; charset=utf-8", include_str!("../pages/home.js")),
    ("docs.js", "text/javascript; charset=utf-8", include_str!("../pages/docs.js")),
];

pub(in crate::http) fn routes() -> Router<Context> {
    Router::new()
        .route("/", get(|| async { Html(HOME) }))
        .route("/docs", get(|| async { Html(DOCS) }))
        .route("/assets/{file}", get(asset))
}

async fn asset(uri: Uri) -> Result<Response> {
    let file = uri.path().rsplit('/').next().unwrap_or("");
    let (_, media_type, text) = ASSETS.into_iter().find(|asset| asset.0 == file).ok_or(Error::NoSuchPath)?;
    let headers = [
        (CONTENT_TYPE, HeaderValue::from_static(media_type)),
        (CACHE_CONTROL, HeaderValue::from_static("no-cache")),
    ];
    Ok((headers, text).into_response())
}
