//! Standard output and standard error that can't be written: a service goes on, a command says so by its exit
//! code, and nothing panics. `/dev/full` is a full disk (full(4)).

use std::fs::File;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use tempfile::tempdir;

use crate::support::service::{Settings, triplanar};

fn full() -> File {
    File::options().write(true).open("/dev/full").expect("full(4)")
}

fn ended(mut child: Child) -> ExitStatus {
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(60) {
        if let Some(status) = child.try_wait().expect("it can be asked") {
            return status;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let _gone_already = child.kill();
    panic!("it did not end");
}

/// A port that was free a moment ago: where the ready line can't be read, nothing else tells.
fn port() -> u16 {
    std::net::TcpListener::bind("127.0.0.1:0").and_then(|free| free.local_addr()).expect("a port").port()
}

/// Starts it, asks until it is ready, ends it with SIGTERM.
async fn serves(shape: impl FnOnce(&mut Command)) {
    let dir = tempdir().expect("a folder");
    let http = format!("127.0.0.1:{}", port());
    let settings = Settings::new().with("http.listen", &http).with("log.filter", "trace");
    let mut command = settings.command(&dir.path().join("data"));
    shape(&mut command);
    let mut child = command.spawn().expect("it starts");
    let begin = Instant::now();
    loop {
        let answer = reqwest::get(format!("http://{http}/readyz")).await;
        if answer.is_ok_and(|answer| answer.status() == 200) {
            break;
        }
        let status = child.try_wait().expect("it can be asked");
        assert!(status.is_none() && begin.elapsed() < Duration::from_secs(60), "not ready: {status:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let term = Command::new("kill").args(["-TERM", &child.id().to_string()]).status().expect("kill runs");
    assert!(term.success());
    assert_eq!(ended(child).code(), Some(0));
}

#[tokio::test]
async fn a_service_goes_on_where_its_log_cannot_be_written() {
    serves(|command| {
        command.stdout(Stdio::null()).stderr(full());
    })
    .await;
    serves(|command| {
        command.stdout(full()).stderr(full());
    })
    .await;
    // Whoever read them has gone.
    serves(|command| {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        command.stdout(writer.try_clone().expect("a pipe's end")).stderr(writer);
        drop(reader);
    })
    .await;
}

#[test]
fn a_command_whose_output_cannot_be_written_says_so_by_its_code() {
    let dir = tempdir().expect("a folder");
    let data = dir.path().join("data");
    let start = || {
        let mut command = triplanar();
        command.args(["rebuild", "--replace", "--data-dir"]).arg(&data);
        command
    };
    std::fs::create_dir(&data).expect("a folder");
    assert!(start().stdout(Stdio::null()).status().expect("it runs").success());
    for arguments in
        [&["check"][..], &["check", "--json"], &["rebuild", "--replace"], &["rebuild", "--replace", "--json"]]
    {
        let mut command = triplanar();
        command.args(arguments).arg("--data-dir").arg(&data);
        let output = command.stdout(full()).output().expect("it runs");
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {told}");
        assert!(told.contains("standard output can't be written"), "{arguments:?}: {told}");
    }
    let mut command = triplanar();
    command.args(["check", "--data-dir", "/nowhere"]).stdout(full()).stderr(full());
    assert_eq!(command.status().expect("it runs").code(), Some(3), "the code stays that of the failure");
}
