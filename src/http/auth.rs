//! Who may do what: one table from route to the roles that it is open to, one middleware.

use axum::extract::{MatchedPath, Request, State};
use axum::http::header::AUTHORIZATION;
use axum::http::{HeaderMap, Method};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use sha2::{Digest, Sha256};

use super::Context;
use super::observe::Caller;
use crate::config::{Role, Token};
use crate::error::{Error, Result};

/// Who may use an operation. `operate` may use all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Anybody: no data of a patient in it.
    Open,
    /// `read`.
    Read,
    /// `upload`.
    Upload,
    /// `read` and `upload`: the state of what was sent.
    State,
    /// `operate` alone.
    Operate,
}

impl Access {
    /// Whether a token of that role may.
    #[must_use]
    pub fn allows(self, role: Role) -> bool {
        match (self, role) {
            (Self::Open, _) | (_, Role::Operate) => true,
            (Self::Read, role) => role == Role::Read,
            (Self::Upload, role) => role == Role::Upload,
            (Self::State, role) => matches!(role, Role::Read | Role::Upload),
            (Self::Operate, _) => false,
        }
    }

    /// The roles that may, as a refused client is told.
    #[must_use]
    pub fn roles(self) -> &'static str {
        match self {
            Self::Open => "none",
            Self::Read => "read or operate",
            Self::Upload => "upload or operate",
            Self::State => "upload, read or operate",
            Self::Operate => "operate",
        }
    }
}

/// The table. What is not in it is for `operate` alone.
const TABLE: &[(&str, &str, Access)] = &[
    ("GET", "/", Access::Open),
    ("GET", "/docs", Access::Open),
    ("GET", "/assets/{file}", Access::Open),
    ("GET", "/openapi.json", Access::Open),
    ("GET", "/healthz", Access::Open),
    ("GET", "/readyz", Access::Open),
    ("GET", "/metrics", Access::Operate),
    ("POST", "/dicom-web/studies", Access::Upload),
    ("POST", "/dicom-web/studies/{study}", Access::Upload),
    ("POST", "/v1/series", Access::Upload),
    ("GET", "/v1/series", Access::Read),
    ("GET", "/v1/series/{series}", Access::State),
    ("DELETE", "/v1/series/{series}", Access::Operate),
    ("POST", "/v1/series/{series}/complete", Access::Upload),
    ("PUT", "/v1/series/{series}/expected-instances", Access::Upload),
    ("POST", "/v1/series/{series}/reconstructions", Access::Upload),
    ("PUT", "/v1/series/{series}/clinical-reconstruction", Access::Operate),
    ("GET", "/v1/series/{series}/cloud", Access::Read),
    ("GET", "/v1/series/{series}/report", Access::Read),
    ("GET", "/v1/reconstructions", Access::Read),
    ("GET", "/v1/reconstructions/{id}", Access::State),
    ("DELETE", "/v1/reconstructions/{id}", Access::Operate),
    ("GET", "/v1/reconstructions/{id}/events", Access::State),
    ("GET", "/v1/reconstructions/{id}/cloud", Access::Read),
    ("GET", "/v1/reconstructions/{id}/report", Access::Read),
    ("GET", "/v1/reconstructions/{id}/slices/{plane}/{picture}", Access::Read),
];

/// Who may use `method` on the route of that template.
#[must_use]
pub fn access(method: &Method, route: &str) -> Access {
    let method = if method == Method::HEAD { "GET" } else { method.as_str() };
    TABLE.iter().find(|row| (row.0, row.1) == (method, route)).map_or(Access::Operate, |row| row.2)
}

/// Whether some method of the route is open to that role: then a method that the route does not
/// have is told so (405), not refused.
fn route_is_open_to(route: &str, role: Option<Role>) -> bool {
    TABLE.iter().filter(|row| row.1 == route).any(|row| match role {
        Some(role) => row.2.allows(role),
        None => row.2 == Access::Open,
    })
}

fn has_method(method: &Method, route: &str) -> bool {
    let method = if method == Method::HEAD { "GET" } else { method.as_str() };
    TABLE.iter().any(|row| (row.0, row.1) == (method, route))
}

/// The layer that checks every request before its handler. Without configured tokens (on
/// loopback, or with `insecure = true`) everything is open.
pub(super) async fn check(State(state): State<Context>, mut request: Request, next: Next) -> Response {
    let tokens = &state.config.http.tokens;
    if tokens.is_empty() {
        return next.run(request).await;
    }
    match judge(tokens, &request) {
        Ok(caller) => {
            let name = caller.map(|token| Caller(token.name.clone()));
            if let Some(name) = &name {
                request.extensions_mut().insert(name.clone());
            }
            let mut response = next.run(request).await;
            if let Some(name) = name {
                response.extensions_mut().insert(name);
            }
            response
        }
        Err(error) => error.into_response(),
    }
}

fn judge<'a>(tokens: &'a [Token], request: &Request) -> Result<Option<&'a Token>> {
    let route = request.extensions().get::<MatchedPath>().map_or("", MatchedPath::as_str);
    let caller = bearer(request.headers()).and_then(|text| find(tokens, text));
    let role = caller.map(|token| token.role);
    if !has_method(request.method(), route) {
        // No such route or method: those who may use the route (or hold any token, where there is
        // no route) learn that.
        let told = if route.is_empty() { role.is_some() } else { route_is_open_to(route, role) };
        return match (told, role) {
            (true, _) => Ok(caller),
            (false, None) => Err(Error::Unauthorized),
            (false, Some(_)) => Err(Error::Forbidden(Access::Operate.roles())),
        };
    }
    let access = access(request.method(), route);
    match role {
        _ if access == Access::Open => Ok(caller),
        None => Err(Error::Unauthorized),
        Some(role) if access.allows(role) => Ok(caller),
        Some(_) => Err(Error::Forbidden(access.roles())),
    }
}

fn bearer(headers: &HeaderMap) -> Option<&str> {
    let value = headers.get(AUTHORIZATION)?.to_str().ok()?;
    let (scheme, token) = value.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| token.trim())
}

/// The token of that text. Only hashes are compared, so the time it takes tells nothing of use.
fn find<'a>(tokens: &'a [Token], text: &str) -> Option<&'a Token> {
    let hash = hex::encode(Sha256::digest(text.as_bytes()));
    tokens.iter().find(|token| token.sha256.eq_ignore_ascii_case(&hash))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_in_the_table_is_for_operate_alone() {
        let access = access(&Method::PATCH, "/v1/series");
        assert_eq!(access, Access::Operate);
        assert!(!access.allows(Role::Read) && !access.allows(Role::Upload) && access.allows(Role::Operate));
    }

    #[test]
    fn a_token_is_found_by_its_hash_alone() {
        // printf swordfish | sha256sum
        let sha256 = "b9f195c5cc7ef6afadbfbc42892ad47d3b24c6bc94bb510c4564a90a14e8b799";
        let tokens = [Token { name: "navigation".into(), role: Role::Read, sha256: sha256.to_uppercase() }];
        assert!(find(&tokens, "swordfish").is_some());
        assert!(find(&tokens, sha256).is_none());
        assert!(find(&tokens, "").is_none());
    }

    #[test]
    fn the_scheme_is_read_in_any_case() {
        let mut headers = HeaderMap::new();
        headers.insert(AUTHORIZATION, "bEARER  abc ".parse().unwrap());
        assert_eq!(bearer(&headers), Some("abc"));
        headers.insert(AUTHORIZATION, "Basic abc".parse().unwrap());
        assert_eq!(bearer(&headers), None);
    }
}
