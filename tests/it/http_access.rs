//! Who may do what.

use reqwest::Method;
use sha2::{Digest, Sha256};
use triplanar::config::{Role, Token};

use crate::support::http::{Server, problem};

const ROLES: [Role; 3] = [Role::Upload, Role::Read, Role::Operate];

fn token(role: Role) -> Token {
    let sha256 = hex::encode(Sha256::digest(format!("secret-{}", role.name())));
    Token { name: role.name().to_owned(), role, sha256 }
}

/// Method, path, and whether upload, read and operate may; all `None` is open to anybody.
const MATRIX: [(&str, &str, Option<[bool; 3]>); 22] = [
    ("GET", "/", None),
    ("GET", "/docs", None),
    ("GET", "/assets/page.css", None),
    ("GET", "/openapi.json", None),
    ("GET", "/healthz", None),
    ("GET", "/readyz", None),
    ("GET", "/metrics", Some([false, false, true])),
    ("POST", "/v1/series", Some([true, false, true])),
    ("GET", "/v1/series", Some([false, true, true])),
    ("HEAD", "/v1/series", Some([false, true, true])),
    ("GET", "/v1/series/1.2", Some([true, true, true])),
    ("DELETE", "/v1/series/1.2", Some([false, false, true])),
    ("POST", "/v1/series/1.2/complete", Some([true, false, true])),
    ("POST", "/v1/series/1.2/reconstructions", Some([true, false, true])),
    ("GET", "/v1/series/1.2/cloud", Some([false, true, true])),
    ("GET", "/v1/series/1.2/report", Some([false, true, true])),
    ("GET", "/v1/reconstructions", Some([false, true, true])),
    ("GET", "/v1/reconstructions/01a20209-e478-722b-88d2-be86ff8bf75c", Some([true, true, true])),
    ("DELETE", "/v1/reconstructions/01a20209-e478-722b-88d2-be86ff8bf75c", Some([false, false, true])),
    ("GET", "/v1/reconstructions/01a20209-e478-722b-88d2-be86ff8bf75c/events", Some([true, true, true])),
    ("GET", "/v1/reconstructions/01a20209-e478-722b-88d2-be86ff8bf75c/cloud", Some([false, true, true])),
    ("POST", "/dicom-web/studies", Some([true, false, true])),
];

#[tokio::test]
async fn each_role_may_do_what_is_its_and_nothing_else() {
    let server = Server::with(|config| config.http.tokens = ROLES.map(token).into()).await;
    for (method, path, allowed) in MATRIX {
        let ask = |authorization: Option<String>| {
            let request = server.request(Method::from_bytes(method.as_bytes()).unwrap(), path);
            authorization.into_iter().fold(request, |r, value| r.header("authorization", value)).send()
        };
        for nobody in
            [None, Some("Bearer wrong".into()), Some("Basic c2VjcmV0".into()), Some("Bearer".into())]
        {
            let response = ask(nobody).await.unwrap();
            if allowed.is_some() {
                assert_eq!(response.headers()["www-authenticate"], "Bearer realm=\"triplanar\"");
                if method == "HEAD" {
                    assert_eq!(response.status(), 401);
                } else {
                    problem(response, 401, "unauthorized").await;
                }
            } else {
                assert_eq!(response.status(), 200, "{method} {path} is open");
            }
        }
        for (role, may) in ROLES.into_iter().zip(allowed.unwrap_or([true; 3])) {
            let status = ask(Some(format!("bearer secret-{}", role.name()))).await.unwrap().status().as_u16();
            assert_eq!(status != 403, may, "{method} {path} as {}: {status}", role.name());
            assert_ne!(status, 401);
        }
    }
}

#[tokio::test]
async fn a_stored_hash_is_no_token_and_unknown_paths_tell_nobody_anything() {
    let server = Server::with(|config| config.http.tokens = ROLES.map(token).into()).await;
    let hash = token(Role::Operate).sha256;
    let response = server.get("/v1/series").bearer_auth(hash).send().await.unwrap();
    problem(response, 401, "unauthorized").await;
    problem(server.get("/nothing").send().await.unwrap(), 401, "unauthorized").await;
    let known = server.get("/nothing").bearer_auth("secret-read").send().await.unwrap();
    problem(known, 404, "not-found").await;
    let wrong_method =
        server.request(Method::PATCH, "/v1/series").bearer_auth("secret-read").send().await.unwrap();
    problem(wrong_method, 405, "method-not-allowed").await;
}
