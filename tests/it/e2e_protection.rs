//! Private: nothing listens off loopback without authentication, nobody gets past it, and what
//! stops a start is said in one line.

use std::net::TcpListener;
use std::process::Output;

use reqwest::{Method, StatusCode};
use serde_json::json;
use sha2::{Digest, Sha256};
use triplanar::dimse::scu::{self, Peer, ScuError};

use crate::support::client::{Client, answer};
use crate::support::pacs::peer;
use crate::support::phantom;
use crate::support::service::{Settings, triplanar};

/// The one line on standard error with which the service must refuse to start.
fn refusal(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success(), "it started: {text}");
    assert!(output.stdout.is_empty(), "it said that it is ready");
    assert_eq!(text.trim_end().lines().count(), 1, "not one line: {text}");
    text
}

fn refused(settings: &Settings) -> String {
    let dir = tempfile::tempdir().unwrap();
    refusal(&settings.refused(dir.path()))
}

#[test]
fn off_loopback_without_a_token_the_service_refuses_and_says_what_to_write() {
    let said = refused(&Settings::new().with("http.listen", "0.0.0.0:0"));
    assert!(said.contains("http.tokens") && said.contains("triplanar token"), "{said}");
}

#[test]
fn off_loopback_without_a_calling_ae_list_the_service_refuses_and_says_what_to_write() {
    let said = refused(&Settings::new().with("dimse.listen", "0.0.0.0:0"));
    assert!(said.contains("calling_ae_titles = ["), "{said}");
}

#[tokio::test]
async fn written_insecure_it_starts_off_loopback() {
    let service = Settings::new().with("http.listen", "0.0.0.0:0").with("insecure", "true").start();
    let client = Client::new(([127, 0, 0, 1], service.http.port()).into());
    assert_eq!(client.get("/healthz").await.status(), StatusCode::OK);
}

#[test]
fn a_port_in_use_is_named_with_its_setting() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    for setting in ["http.listen", "dimse.listen"] {
        let said = refused(&Settings::new().with(setting, &address));
        assert!(said.contains(setting) && said.contains(&address), "{said}");
    }
}

#[test]
fn a_data_directory_serves_one_service_at_a_time() {
    let service = Settings::new().start();
    let said = refusal(&Settings::new().refused(&service.data_dir()));
    assert!(said.contains("storage.data_dir"), "{said}");
}

#[test]
fn a_data_directory_that_cannot_be_written_is_named() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let said = refusal(&Settings::new().refused(&file.path().join("data")));
    assert!(said.contains("storage.data_dir") && said.contains("data"), "{said}");
}

#[test]
fn an_unknown_setting_and_a_missing_file_are_named() {
    let said = refused(&Settings::new().with("http.lisen", "127.0.0.1:0"));
    assert!(said.contains("lisen"), "{said}");
    let mut command = triplanar();
    command.args(["serve", "--config", "/nonexistent/triplanar.toml"]);
    let said = refusal(&crate::support::service::run(command));
    assert!(said.contains("/nonexistent/triplanar.toml"), "{said}");
}

fn with_tokens() -> Settings {
    let line = |role: &str| {
        let hash = hex::encode(Sha256::digest(format!("secret-{role}")));
        format!("{{ name = \"{role}\", role = \"{role}\", sha256 = \"{hash}\" }}")
    };
    let lines = ["upload", "read", "operate"].map(line).join(", ");
    phantom::settings().with("http.tokens", &format!("[{lines}]"))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_without_a_token_or_with_a_wrong_role_is_refused() {
    let service = with_tokens().start();
    let nobody = Client::new(service.http);
    let [upload, read, operate] =
        ["upload", "read", "operate"].map(|role| nobody.with_token(&format!("secret-{role}")));
    let instance = &phantom::small().files[0];
    let series = format!("/v1/series/{}", phantom::small().uid);

    let expect = |client: &Client, method: Method, path: &str, status: StatusCode, code: &'static str| {
        let request = client.request(method.clone(), path).body(Vec::new());
        let what = format!("{method} {path}");
        async move {
            let (got, body) = answer(request).await;
            assert_eq!(got, status, "{what}: {body}");
            assert_eq!(body["type"], json!(format!("urn:triplanar:problem:{code}")), "{what}: {body}");
        }
    };
    for (method, path) in [
        (Method::GET, "/v1/series"),
        (Method::POST, "/v1/series"),
        (Method::POST, "/dicom-web/studies"),
        (Method::GET, "/v1/reconstructions"),
        (Method::DELETE, series.as_str()),
        (Method::GET, "/metrics"),
    ] {
        expect(&nobody, method.clone(), path, StatusCode::UNAUTHORIZED, "unauthorized").await;
        expect(&nobody.with_token("guess"), method, path, StatusCode::UNAUTHORIZED, "unauthorized").await;
    }
    for (client, method, path) in [
        (&read, Method::POST, "/v1/series"),
        (&read, Method::DELETE, series.as_str()),
        (&upload, Method::GET, "/v1/series"),
        (&upload, Method::DELETE, series.as_str()),
    ] {
        expect(client, method, path, StatusCode::FORBIDDEN, "forbidden").await;
    }
    let (status, body) = upload.upload("application/dicom", instance.clone()).await;
    assert!(status.is_success(), "{status}: {body}");
    assert_eq!(read.get(&series).await.status(), StatusCode::OK);
    assert_eq!(operate.get(&series).await.status(), StatusCode::OK);
    let (status, _) = answer(operate.request(Method::DELETE, &series)).await;
    assert!(status.is_success(), "operate may remove: {status}");
    let log = service.log();
    assert!(!log.contains("secret-"), "a token stands in the log:\n{log}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_association_from_an_unknown_ae_is_rejected() {
    let service = Settings::new().with("dimse.calling_ae_titles", "[\"PACS\"]").start();
    scu::echo(&peer(&service)).await.expect("a known AE may associate");
    let stranger = Peer { calling_ae_title: "STRANGER".to_owned(), ..peer(&service) };
    rejected(&stranger, "calling").await;
    let elsewhere = Peer { called_ae_title: "ELSEWHERE".to_owned(), ..peer(&service) };
    rejected(&elsewhere, "called").await;
}

/// A-ASSOCIATE-RJ, permanent, for the reason named (PS3.8 table 9-21).
async fn rejected(peer: &Peer, whose: &str) {
    match scu::echo(peer).await {
        Err(ScuError::Rejected { transient: false, reason }) => {
            assert!(reason.to_lowercase().contains(whose), "{reason}");
        }
        other => panic!("not rejected for good: {other:?}"),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn no_patient_identity_stands_in_log_or_metrics() {
    let service = phantom::settings().with("log.filter", "debug").start();
    let series = phantom::small();
    let client = Client::new(service.http);
    crate::support::pacs::push(&service, &series.files).await;
    client.settled(&series.uid, 1).await;
    let identity = identity_of(&series.files[0]);
    assert!(identity.len() >= 2, "the phantom has a name and an id: {identity:?}");
    let told = service.log() + &client.get("/metrics").await.text().await.unwrap();
    for value in identity {
        assert!(!told.contains(&value), "{value:?} stands in log or metrics");
    }
    assert!(told.contains(&series.uid), "the log names the series");
}

/// Patient's Name, Patient ID, Patient's Birth Date, Accession Number, as far as they are there.
fn identity_of(file: &[u8]) -> Vec<String> {
    use dicom_dictionary_std::tags;
    let object = dicom_object::from_reader(file).expect("a Part 10 file");
    [tags::PATIENT_NAME, tags::PATIENT_ID, tags::PATIENT_BIRTH_DATE, tags::ACCESSION_NUMBER]
        .into_iter()
        .filter_map(|tag| Some(object.element(tag).ok()?.to_str().ok()?.trim().to_owned()))
        .filter(|value| !value.is_empty())
        .collect()
}
