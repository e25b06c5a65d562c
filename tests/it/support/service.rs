//! The real binary as a process of its own: temporary data directory, free ports, kill and restart.

use std::io::{BufRead, BufReader, Read};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};

/// Far beyond what a start or a stop takes; a test that waits so long has failed.
const PATIENCE: Duration = Duration::from_secs(60);

/// How a service is to be started.
#[derive(Debug, Clone, Default)]
pub(crate) struct Settings {
    environment: Vec<(String, String)>,
    without_override: bool,
}

impl Settings {
    /// Free loopback ports, short quiet times, any disk.
    pub(crate) fn new() -> Self {
        Self::default()
            .with("http.listen", "127.0.0.1:0")
            .with("dimse.listen", "127.0.0.1:0")
            .with("storage.min_free_bytes", "1000000")
            .with("intake.quiet_after_association", "0.3")
            .with("jobs.retry_backoff", "0.2")
    }

    /// One setting, named as in `config/triplanar.toml`: `http.listen`.
    pub(crate) fn with(mut self, setting: &str, value: &str) -> Self {
        let name = format!("TRIPLANAR_{}", setting.replace('.', "__").to_uppercase());
        self.environment.push((name, value.to_owned()));
        self
    }

    /// Root's right to read and write whatever it likes is taken from it (`setpriv` of util-linux).
    pub(crate) fn without_override(self) -> Self {
        Self { without_override: true, ..self }
    }

    /// `triplanar serve` with these settings on this data directory.
    pub(crate) fn command(&self, data_dir: &Path) -> Command {
        let mut command = triplanar();
        if self.without_override {
            let program = command.get_program().to_owned();
            command = without_settings(Command::new("setpriv"));
            command.args(["--bounding-set", "-dac_override,-dac_read_search", "--"]).arg(program);
        }
        command.arg("serve").envs(self.environment.iter().cloned());
        command.env("TRIPLANAR_STORAGE__DATA_DIR", toml_text(data_dir));
        command
    }

    /// Starts the service on a new data directory and waits until it is ready.
    pub(crate) fn start(&self) -> Service {
        let dir = tempfile::tempdir().expect("a temporary directory");
        self.start_on(dir)
    }

    /// Starts the service on what an earlier one left in `dir`.
    pub(crate) fn start_on(&self, dir: tempfile::TempDir) -> Service {
        let mut child = self
            .command(&dir.path().join("data"))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the binary starts");
        let log = Log::default();
        let (mut stderr, kept) = (child.stderr.take().expect("piped"), log.clone());
        std::thread::spawn(move || kept.collect(&mut stderr));
        let ready = first_line(child.stdout.take().expect("piped")).unwrap_or_else(|| {
            let _gone_already = child.kill();
            let status = child.wait();
            panic!("not ready: {status:?}\n{}", log.text())
        });
        let http = address_after(&ready, "http://");
        let dimse = address_after(&ready, "@");
        Service { child, http, dimse, dir: Some(dir), log }
    }

    /// Starts the service where it must refuse to: its exit status and what it said.
    pub(crate) fn refused(&self, data_dir: &Path) -> Output {
        run(self.command(data_dir))
    }
}

/// The binary, with no setting from the environment of the test.
pub(crate) fn triplanar() -> Command {
    without_settings(Command::new(env!("CARGO_BIN_EXE_triplanar-tested")))
}

fn without_settings(mut command: Command) -> Command {
    for (name, _) in std::env::vars_os() {
        if name.to_string_lossy().starts_with("TRIPLANAR_") {
            command.env_remove(name);
        }
    }
    command.stdin(Stdio::null());
    command
}

/// Runs a command to its end, which must come.
pub(crate) fn run(mut command: Command) -> Output {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
    let (mut out, mut err) = (child.stdout.take().expect("piped"), child.stderr.take().expect("piped"));
    let stdout = std::thread::spawn(move || read_all(&mut out));
    let stderr = std::thread::spawn(move || read_all(&mut err));
    let status = wait(&mut child, PATIENCE * 5);
    Output { status, stdout: stdout.join().expect("no panic"), stderr: stderr.join().expect("no panic") }
}

/// A running service; dropped, it is killed.
#[derive(Debug)]
pub(crate) struct Service {
    child: Child,
    /// Where HTTP listens.
    pub(crate) http: SocketAddr,
    /// Where DICOM listens.
    pub(crate) dimse: SocketAddr,
    dir: Option<tempfile::TempDir>,
    log: Log,
}

impl Service {
    /// The data directory.
    pub(crate) fn data_dir(&self) -> PathBuf {
        self.dir.as_ref().expect("a service that runs has its directory").path().join("data")
    }

    /// The process id.
    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// What it logged so far.
    pub(crate) fn log(&self) -> String {
        self.log.text()
    }

    /// Whether the process still runs.
    pub(crate) fn is_alive(&mut self) -> bool {
        self.child.try_wait().expect("the process can be asked").is_none()
    }

    /// `kill -9`; gives back what it left.
    pub(crate) fn kill(mut self) -> tempfile::TempDir {
        self.child.kill().expect("the process can be killed");
        self.child.wait().expect("the process ends");
        self.dir.take().expect("taken once")
    }

    /// SIGTERM, as a service manager stops it; gives back how it ended and what it left.
    pub(crate) fn terminate(mut self) -> (ExitStatus, tempfile::TempDir) {
        let pid = self.child.id().to_string();
        let sent = Command::new("kill").args(["-TERM", &pid]).status().expect("kill runs");
        assert!(sent.success(), "SIGTERM could not be sent");
        let status = wait(&mut self.child, PATIENCE);
        (status, self.dir.take().expect("taken once"))
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        let _gone_already = self.child.kill();
        let _gone_already = self.child.wait();
        if std::thread::panicking() {
            eprintln!("---- the service's log\n{}", self.log());
        }
    }
}

fn wait(child: &mut Child, patience: Duration) -> ExitStatus {
    let begin = Instant::now();
    loop {
        if let Some(status) = child.try_wait().expect("the process can be asked") {
            return status;
        }
        if begin.elapsed() > patience {
            let _gone_already = child.kill();
            panic!("the process did not end within {patience:?}");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn read_all(from: &mut impl Read) -> Vec<u8> {
    let mut bytes = Vec::new();
    from.read_to_end(&mut bytes).expect("a pipe can be read");
    bytes
}

/// What a process writes to standard error, collected as it comes.
#[derive(Debug, Clone, Default)]
struct Log(Arc<Mutex<Vec<u8>>>);

impl Log {
    fn collect(&self, from: &mut impl Read) {
        let mut chunk = [0; 4096];
        while let Ok(read @ 1..) = from.read(&mut chunk) {
            self.0.lock().expect("no panic while locked").extend(&chunk[..read]);
        }
    }

    fn text(&self) -> String {
        String::from_utf8_lossy(&self.0.lock().expect("no panic while locked")).into_owned()
    }
}

/// The first line, or `None` if there is none in time. What follows is read and dropped, so that
/// the process never waits for us.
fn first_line(from: impl Read + Send + 'static) -> Option<String> {
    let (sender, receiver) = mpsc::channel();
    std::thread::spawn(move || {
        for line in BufReader::new(from).lines().map_while(Result::ok) {
            let _only_the_first_is_wanted = sender.send(line);
        }
    });
    receiver.recv_timeout(PATIENCE).ok()
}

fn address_after(line: &str, mark: &str) -> SocketAddr {
    line.split(mark)
        .nth(1)
        .and_then(|rest| rest.split([' ', '/', ',']).next())
        .and_then(|address| address.parse().ok())
        .unwrap_or_else(|| panic!("no address after {mark:?} in {line:?}"))
}

fn toml_text(path: &Path) -> String {
    format!("{:?}", path.to_str().expect("a temporary directory has a plain name"))
}
