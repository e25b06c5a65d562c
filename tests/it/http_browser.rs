//! A browser is no way in: whose requests are answered is told by Host, whose may change something
//! by Origin and Sec-Fetch-Site. Hostile requests are written byte by byte; no client would send them.

use reqwest::Method;
use triplanar::config::{Role, Token};

use crate::support::http::{Server, problem, zip_of};
use crate::support::raw;

/// Statuses of a request with these header lines.
async fn status(server: &Server, method: &str, path: &str, version: &str, lines: &str) -> String {
    let request = format!("{method} {path} HTTP/{version}\r\n{lines}connection: close\r\n\r\n");
    let answer = raw::exchange(server.address, request.as_bytes()).await;
    answer.split(' ').nth(1).unwrap_or_else(|| panic!("{request}{answer}")).to_owned()
}

#[tokio::test]
async fn without_tokens_only_loopback_names_and_the_listed_ones_are_answered() {
    let server =
        Server::with(|config| config.http.hosts = vec!["CT.example.org".into(), "10.1.2.3".into()]).await;
    for (host, expected) in [
        ("localhost", "200"),
        ("LOCALHOST:1234", "200"),
        ("127.0.0.1", "200"),
        ("127.200.3.4:80", "200"),
        ("[::1]:8080", "200"),
        ("ct.example.org", "200"),
        ("10.1.2.3:8443", "200"),
        ("evil.example", "421"),
        ("rebind.evil.example:8080", "421"),
        ("localhost.evil.example", "421"),
        ("127.0.0.1.evil.example", "421"),
        ("127.1", "421"),
        ("10.1.2.4", "421"),
        ("[::2]", "421"),
        ("", "400"),
        (":80", "400"),
        ("a b", "400"),
        ("a/b", "400"),
        ("u@localhost", "400"),
        ("localhost:99999", "400"),
        ("localhost:x", "400"),
        ("[::1", "400"),
        ("localhost, evil.example", "400"),
    ] {
        for path in ["/v1/series", "/", "/healthz"] {
            assert_eq!(
                status(&server, "GET", path, "1.1", &format!("host: {host}\r\n")).await,
                expected,
                "{host} {path}"
            );
        }
    }
    let response = server.get("/v1/series").header("host", "evil.example").send().await.unwrap();
    problem(response, 421, "misdirected-request").await;
}

#[tokio::test]
async fn a_host_is_named_once_and_a_probe_of_http_1_0_needs_none() {
    let server = Server::start().await;
    assert_eq!(status(&server, "GET", "/healthz", "1.1", "").await, "400");
    assert_eq!(
        status(&server, "GET", "/v1/series", "1.1", "host: localhost\r\nhost: localhost\r\n").await,
        "400"
    );
    assert_eq!(
        status(&server, "GET", "/v1/series", "1.1", "host: localhost\r\nHost: evil.example\r\n").await,
        "400"
    );
    for path in ["/healthz", "/readyz"] {
        assert_eq!(status(&server, "GET", path, "1.0", "").await, "200", "{path}");
        assert_eq!(status(&server, "GET", path, "1.0", "host: evil.example\r\n").await, "421", "{path}");
    }
    assert_eq!(status(&server, "GET", "/v1/series", "1.0", "host: localhost\r\n").await, "200");
    assert_eq!(status(&server, "GET", "/v1/series", "1.0", "").await, "421");
    // The authority of an absolute target counts, whatever Host says (RFC 9112 section 3.2.2).
    for (target, host, expected) in [
        ("http://evil.example/v1/series", "localhost", "421"),
        ("http://localhost:8080/v1/series", "evil.example", "200"),
        ("http://x@localhost/v1/series", "localhost", "400"),
        ("http://localhost/v1/series", "a b", "400"),
    ] {
        assert_eq!(
            status(&server, "GET", target, "1.1", &format!("host: {host}\r\n")).await,
            expected,
            "{target}"
        );
    }
    assert_eq!(status(&server, "GET", "http://localhost/v1/series", "1.1", "").await, "400");
}

#[tokio::test]
async fn with_tokens_any_host_is_answered_unless_some_are_listed() {
    let token = Token { name: "t".into(), role: Role::Read, sha256: "0".repeat(64) };
    let open = Server::with(|config| config.http.tokens = vec![token.clone()]).await;
    assert_eq!(status(&open, "GET", "/v1/series", "1.1", "host: ct.example.org\r\n").await, "401");
    let listed = Server::with(|config| {
        config.http.tokens = vec![token];
        config.http.hosts = vec!["ct.example.org".into()];
    })
    .await;
    assert_eq!(status(&listed, "GET", "/v1/series", "1.1", "host: ct.example.org\r\n").await, "401");
    assert_eq!(status(&listed, "GET", "/v1/series", "1.1", "host: evil.example\r\n").await, "421");
}

#[tokio::test]
async fn a_page_of_another_origin_changes_nothing() {
    let server = Server::start().await;
    server.upload("", zip_of(1, 3)).await;
    let uid = crate::support::http::slices(1, 1)[0].series_uid();
    let port = server.address.port();
    let foreign = [
        ("origin", "http://evil.example".to_owned()),
        ("origin", "null".to_owned()),
        ("origin", format!("http://127.0.0.1:{}", port ^ 1)),
        ("origin", format!("https://127.0.0.1:{port}").replace("127.0.0.1", "localhost")),
        ("sec-fetch-site", "cross-site".to_owned()),
        ("sec-fetch-site", "same-site".to_owned()),
    ];
    let changes = [
        (Method::POST, "/v1/series".to_owned()),
        (Method::POST, "/dicom-web/studies".to_owned()),
        (Method::POST, format!("/v1/series/{uid}/complete")),
        (Method::POST, format!("/v1/series/{uid}/reconstructions")),
        (Method::PUT, format!("/v1/series/{uid}/expected-instances")),
        (Method::DELETE, format!("/v1/series/{uid}")),
        (Method::OPTIONS, "/v1/series".to_owned()),
    ];
    for (name, value) in &foreign {
        for (method, path) in &changes {
            let response = server.request(method.clone(), path).header(*name, value).send().await.unwrap();
            assert!(!response.headers().contains_key("access-control-allow-origin"));
            problem(response, 403, "foreign-origin").await;
        }
        // Reading is harmless: without CORS headers the page does not get the answer.
        let read = server.get("/v1/series").header(*name, value).send().await.unwrap();
        assert_eq!(read.status(), 200);
        assert!(!read.headers().contains_key("access-control-allow-origin"));
        assert_eq!(read.headers()["cross-origin-resource-policy"], "same-origin");
    }
    assert_eq!(
        server.get(&format!("/v1/series/{uid}")).send().await.unwrap().status(),
        200,
        "it is still there"
    );
    // Our own page, and what is no browser, may.
    let own = format!("http://127.0.0.1:{port}");
    for (name, value) in
        [("origin", own.as_str()), ("sec-fetch-site", "same-origin"), ("sec-fetch-site", "none")]
    {
        let path = format!("/v1/series/{uid}/complete");
        assert_eq!(
            server.post(&path).header(name, value).send().await.unwrap().status(),
            202,
            "{name} {value}"
        );
    }
    assert_eq!(
        server.request(Method::DELETE, &format!("/v1/series/{uid}")).send().await.unwrap().status(),
        204
    );
}

#[tokio::test]
async fn an_expected_number_has_the_same_limits_wherever_it_is_said() {
    let server = Server::start().await;
    // No more than a series may have: intake.max_series_instances.
    for number in ["0", "10001", "18446744073709551615"] {
        let response =
            server.post(&format!("/v1/series?expect={number}")).body(zip_of(1, 3)).send().await.unwrap();
        problem(response, 400, "invalid-parameter").await;
        let response = server
            .request(Method::PUT, "/v1/series/1.2.3/expected-instances")
            .header("content-type", "application/json")
            .body(format!("{{\"instances\":{number}}}"))
            .send()
            .await
            .unwrap();
        problem(response, 422, "invalid-body").await;
    }
    let listed: serde_json::Value = server.get("/v1/series").send().await.unwrap().json().await.unwrap();
    assert_eq!(listed["items"].as_array().unwrap().len(), 0, "nothing was stored");
    server.upload("?expect=10000", zip_of(1, 3)).await;
}
