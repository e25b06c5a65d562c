//! The query parameters of a request, held against those that its operation describes: one that it does
//! not know is an error under `/v1`, not silence; DICOMweb wants it ignored, and we say so.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use axum::extract::{MatchedPath, Query, Request, State};
use axum::http::header::WARNING;
use axum::http::{HeaderValue, Method};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use utoipa::openapi::path::{Operation, ParameterIn};
use utoipa::openapi::{OpenApi, RefOr};

use super::describe::operations_of;
use crate::error::Error;

/// Where a parameter that is not known is refused.
const OURS: &str = "/v1/";
/// Where it is ignored (PS3.18 section 8.3), and the answer warns.
const DICOMWEB: &str = "/dicom-web/";

/// Warning code 299: miscellaneous, persistent (RFC 7234 section 5.5.7).
const IGNORED: &str = "299 triplanar \"query parameters that are not supported were ignored\"";

/// The names that operations take, by path and method.
#[derive(Debug, Default)]
pub(super) struct Known(BTreeMap<String, Vec<(Method, BTreeSet<String>)>>);

impl Known {
    pub(super) fn of(mut api: OpenApi) -> Arc<Self> {
        let mut known = Self::default();
        for (path, item) in &mut api.paths.paths {
            let operations = operations_of(item).map(|(method, operation)| (method, names(operation)));
            known.0.insert(path.clone(), operations.collect());
        }
        Arc::new(known)
    }

    fn names(&self, path: &str, method: &Method) -> Option<&BTreeSet<String>> {
        let method = if method == Method::HEAD { &Method::GET } else { method };
        self.0.get(path)?.iter().find(|(it, _)| it == method).map(|(_, names)| names)
    }
}

fn names(operation: &Operation) -> BTreeSet<String> {
    let parameters = operation.parameters.iter().flatten();
    let in_query = parameters.filter_map(|it| match it {
        RefOr::T(it) if it.parameter_in == ParameterIn::Query => Some(it.name.clone()),
        RefOr::T(_) | RefOr::Ref(_) => None,
    });
    in_query.collect()
}

/// Refuses a request with a parameter that its operation does not know.
pub(super) async fn check(State(known): State<Arc<Known>>, request: Request, next: Next) -> Response {
    let path = request.extensions().get::<MatchedPath>().map(MatchedPath::as_str);
    let Some((path, names)) = path.and_then(|path| Some((path, known.names(path, request.method())?))) else {
        return next.run(request).await;
    };
    let given = match Query::<Vec<(String, String)>>::try_from_uri(request.uri()) {
        Ok(Query(given)) => given,
        Err(rejection) => return invalid(rejection.body_text()).into_response(),
    };
    let Some((unknown, _)) = given.iter().find(|(name, _)| !names.contains(name)) else {
        return next.run(request).await;
    };
    if path.starts_with(OURS) {
        return invalid(unknown_of(unknown, names)).into_response();
    }
    let warns = path.starts_with(DICOMWEB);
    let mut response = next.run(request).await;
    if warns {
        response.headers_mut().insert(WARNING, HeaderValue::from_static(IGNORED));
    }
    response
}

fn invalid(detail: String) -> Error {
    Error::InvalidParameter { name: "query".to_owned(), detail }
}

fn unknown_of(unknown: &str, names: &BTreeSet<String>) -> String {
    let unknown: String = unknown.chars().filter(|it| !it.is_control()).take(64).collect();
    if names.is_empty() {
        return format!("unknown parameter `{unknown}`: none is taken here");
    }
    let names = names.iter().map(String::as_str).collect::<Vec<_>>().join(", ");
    format!("unknown parameter `{unknown}`: there are {names}")
}
