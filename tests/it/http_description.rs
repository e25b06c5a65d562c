//! The API's description.

use std::path::Path;

use serde_json::Value;

use crate::support::http::Server;

#[test]
fn api_openapi_json_is_what_the_code_says() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../api/openapi.json");
    let stored = std::fs::read_to_string(&file).unwrap_or_default();
    assert!(
        stored == triplanar::http::openapi_json(),
        "the API has changed: cargo run -- openapi > api/openapi.json"
    );
}

/// Every `content` of a description, with its media type.
fn contents<'a>(value: &'a Value, found: &mut Vec<(&'a str, &'a Value)>) {
    if let Some(content) = value.get("content").and_then(Value::as_object) {
        found.extend(content.iter().map(|(media_type, content)| (media_type.as_str(), content)));
    }
    match value {
        Value::Object(object) => object.values().for_each(|value| contents(value, found)),
        Value::Array(array) => array.iter().for_each(|value| contents(value, found)),
        _ => {}
    }
}

#[test]
fn bodies_of_bytes_are_strings_and_not_lists_of_numbers() {
    let api: Value = serde_json::from_str(&triplanar::http::openapi_json()).unwrap();
    let mut found = Vec::new();
    contents(&api["paths"], &mut found);
    let mut binary = 0;
    for (media_type, content) in found {
        let (schema, is_json) = (&content["schema"], media_type.ends_with("json"));
        if !is_json && schema.get("$ref").is_none() {
            assert_eq!(schema["type"], "string", "{media_type}: {schema}");
        }
        binary += usize::from(schema["format"] == "binary");
        assert!(!media_type.starts_with("text/") || schema["format"] != "binary", "{media_type}");
    }
    // Four operations that serve clouds or pictures, three that take instances.
    assert!(binary > 20, "{binary} bodies of bytes");
    let files = &api["components"]["schemas"]["UploadForm"]["properties"]["files"];
    assert_eq!(files["items"], serde_json::json!({ "type": "string", "format": "binary" }));
}

#[test]
fn a_token_is_described_as_what_a_service_may_ask_for() {
    let api: Value = serde_json::from_str(&triplanar::http::openapi_json()).unwrap();
    let security = &api["paths"]["/metrics"]["get"]["security"];
    assert_eq!(security, &serde_json::json!([{ "bearer": [] }, {}]));
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
