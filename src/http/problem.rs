//! Problem details (RFC 9457): the one place where an [`Error`] becomes an answer.

use axum::Json;
use axum::http::header::{CONTENT_RANGE, CONTENT_TYPE, RETRY_AFTER, WWW_AUTHENTICATE};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};

use super::observe::RequestId;
use super::refused::{Refusal, Skipped};
use crate::error::Error;

/// The media type of every answer that is a problem.
pub const MEDIA_TYPE: &str = "application/problem+json";

/// Seconds after which a client that was told 503 may try again.
const RETRY_AFTER_SECONDS: HeaderValue = HeaderValue::from_static("5");

/// What went wrong with a request (RFC 9457).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[schema(example = json!({
    "type": "urn:triplanar:problem:not-found",
    "title": "Not found",
    "status": 404,
    "detail": "no series with the id 1.2.826.0.1.3680043.10.9999.5.2",
    "instance": "urn:uuid:019aa7a0-6f3c-7c1e-9d59-0d1c3a1d1c55"
}))]
pub struct Problem {
    /// Stable: `urn:triplanar:problem:` and the problem's code.
    #[serde(rename = "type")]
    #[schema(pattern = "^urn:triplanar:problem:[a-z0-9-]+$")]
    pub type_uri: String,
    /// The same text for each problem of this type.
    pub title: String,
    /// The HTTP status again.
    #[schema(minimum = 400, maximum = 599)]
    pub status: u16,
    /// What was wrong this time and what to do next.
    pub detail: String,
    /// This occurrence: the request's id, as it stands in the service's log and in `X-Request-Id`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub instance: Option<String>,
    /// Instances of an upload that were refused, where all were.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub refused: Vec<Refusal>,
    /// Files of an archive that are no DICOM instances, where nothing else was in it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skipped: Vec<Skipped>,
}

impl Problem {
    /// The problem as which a client is told of `error`.
    #[must_use]
    pub fn of(error: &Error) -> Self {
        let mapping = error.mapping();
        Self {
            type_uri: format!("urn:triplanar:problem:{}", mapping.code),
            title: mapping.title.to_owned(),
            status: mapping.http_status,
            detail: error.to_string(),
            instance: RequestId::current().map(|id| id.urn()),
            refused: Vec::new(),
            skipped: Vec::new(),
        }
    }

    /// The answer to `error` with this body.
    pub(super) fn respond(self, error: &Error) -> Response {
        if let Error::Internal(cause) = error {
            tracing::error!(cause = %chain(cause.as_ref()), "a request failed");
        }
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        (status, headers(error), Json(self)).into_response()
    }
}

impl IntoResponse for Error {
    fn into_response(self) -> Response {
        Problem::of(&self).respond(&self)
    }
}

fn headers(error: &Error) -> HeaderMap {
    let mut headers = HeaderMap::new();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(MEDIA_TYPE));
    let more: Option<(HeaderName, HeaderValue)> = match error {
        Error::Unauthorized => {
            Some((WWW_AUTHENTICATE, HeaderValue::from_static("Bearer realm=\"triplanar\"")))
        }
        Error::Busy(_)
        | Error::OutOfDescriptors
        | Error::OutOfMemory
        | Error::NotPermitted
        | Error::ShuttingDown => Some((RETRY_AFTER, RETRY_AFTER_SECONDS)),
        Error::NotCurrent { retry_after_s, .. } => Some((RETRY_AFTER, HeaderValue::from(*retry_after_s))),
        Error::RangeNotSatisfiable { length } => {
            HeaderValue::from_str(&format!("bytes */{length}")).ok().map(|value| (CONTENT_RANGE, value))
        }
        _ => None,
    };
    headers.extend(more);
    headers
}

/// The error and its causes on one line.
fn chain(error: &(dyn std::error::Error + 'static)) -> String {
    let causes = std::iter::successors(Some(error), |cause| cause.source());
    causes.map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

/// What a handler that panicked answers; the panic's message goes to the log alone.
pub(super) fn of_panic(panic: Box<dyn std::any::Any + Send + 'static>) -> Response {
    let message = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("no message");
    Error::internal(format!("a handler panicked: {message}")).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_internal_cause_is_not_told() {
        let problem = Problem::of(&Error::internal("the password is swordfish"));
        assert_eq!(problem.status, 500);
        assert!(!serde_json::to_string(&problem).unwrap().contains("swordfish"));
    }

    #[test]
    fn the_type_is_the_stable_urn() {
        let problem = Problem::of(&Error::Busy("uploads"));
        assert_eq!(problem.type_uri, "urn:triplanar:problem:busy");
        let response = Error::Busy("uploads").into_response();
        assert!(response.headers().contains_key(RETRY_AFTER));
        assert_eq!(response.headers()[CONTENT_TYPE], MEDIA_TYPE);
    }
}
