//! `triplanar token` as an operator uses it: paste what it prints.

use sha2::{Digest, Sha256};

use crate::support::client::Client;
use crate::support::service::{Settings, run, triplanar};

/// What it prints to standard output, and the tokens.
fn made(arguments: &[&str]) -> (String, Vec<String>) {
    let mut command = triplanar();
    command.arg("token").args(arguments);
    let ended = run(command);
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let shown = String::from_utf8(ended.stderr).expect("text");
    let tokens = shown.lines().filter(|line| line.starts_with("token of"));
    let tokens = tokens.filter_map(|line| line.rsplit(' ').next()).map(str::to_owned).collect();
    (String::from_utf8(ended.stdout).expect("text"), tokens)
}

#[tokio::test]
async fn what_it_prints_can_be_pasted_under_http_and_its_tokens_open_the_service() {
    let (lines, tokens) =
        made(&["--role", "read", "--name", "navigation", "--role", "operate", "--name", "admin"]);
    let [read, operate] = tokens.as_slice() else { panic!("two tokens: {tokens:?}") };
    assert!(read.len() >= 32 && lines.contains(&hex::encode(Sha256::digest(read))), "{lines}");
    assert!(!lines.contains(&**read), "the token itself has no place in the configuration");
    let dir = tempfile::tempdir().expect("a folder");
    let config = dir.path().join("my.toml");
    std::fs::write(&config, format!("[http]\n{lines}max_uploads = 2\n\n[jobs]\nworkers = 1\n"))
        .expect("a file");
    let service = Settings::new().with("config", &config.display().to_string()).start();
    let client = Client::new(service.http);
    for (token, series, metrics) in [(read, 200, 403), (operate, 200, 200)] {
        for (path, expected) in [("/v1/series", series), ("/metrics", metrics)] {
            let answer = client.with_token(token).get(path).await;
            assert_eq!(answer.status().as_u16(), expected, "{path}");
        }
    }
    assert_eq!(client.get("/v1/series").await.status(), 401);
}

#[test]
fn one_token_is_a_list_too_and_more_names_than_roles_are_refused() {
    let (lines, tokens) = made(&["--role", "upload"]);
    assert_eq!(tokens.len(), 1);
    let parsed: toml::Table = lines.parse().expect("TOML");
    assert_eq!(parsed["tokens"][0]["role"].as_str(), Some("upload"), "{lines}");
    let mut command = triplanar();
    command.args(["token", "--role", "read", "--name", "a", "--name", "b"]);
    assert_eq!(run(command).status.code(), Some(2));
}
