//! The API's description.

use std::path::Path;

use crate::support::http::Server;

#[test]
fn api_openapi_json_is_what_the_code_says() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("api/openapi.json");
    let stored = std::fs::read_to_string(&file).unwrap_or_default();
    assert!(
        stored == triplanar::http::openapi_json(),
        "the API has changed: cargo run -- openapi > api/openapi.json"
    );
}

#[tokio::test]
async fn the_service_serves_its_description_and_pages_from_itself() {
    let server = Server::start().await;
    let served: serde_json::Value = server.get("/openapi.json").send().await.unwrap().json().await.unwrap();
    let generated: serde_json::Value = serde_json::from_str(&triplanar::http::openapi_json()).unwrap();
    assert_eq!(served, generated);
    assert_eq!(served["openapi"], "3.1.0");

    for page in ["/", "/docs"] {
        let response = server.get(page).send().await.unwrap();
        assert_eq!(response.headers()["content-type"], "text/html; charset=utf-8");
        assert!(
            response.headers()["content-security-policy"].to_str().unwrap().contains("default-src 'none'")
        );
        assert_eq!(response.headers()["x-content-type-options"], "nosniff");
        let html = response.text().await.unwrap();
        // Whatever the page loads is the service's own, and there.
        for link in html.split(['"', '\'']).filter(|text| text.starts_with("/assets/")) {
            assert_eq!(server.get(link).send().await.unwrap().status(), 200, "{link}");
        }
        assert!(!html.contains("src=\"http") && !html.contains("<script>"), "{page} loads from elsewhere");
    }
}
