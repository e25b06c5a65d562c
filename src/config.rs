//! Settings: compiled-in defaults ← file ← environment ← flags.

mod host_name;

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Deserializer};

use crate::crowd::Network;
use crate::dicom::ae_title::AeTitle;
use crate::dicom::scan::Limits;
use crate::dicom::series::ReadLimits;
use crate::memory;
use crate::pipeline::Parameters;

pub(crate) use host_name::HostName;

/// `config/triplanar.toml`: explains every setting and *is* the defaults.
pub const DEFAULTS: &str = include_str!("../config/triplanar.toml");

/// Prefix of settings in the environment.
const PREFIX: &str = "TRIPLANAR_";

/// The longest time that a setting can say: ten years.
const MAX_SECONDS: f64 = 315_360_000.0;

/// What an AE title may be (PS3.5 section 6.2).
const AE_TITLE: &str = "1 to 16 ASCII characters, no control character, no backslash, not only spaces";

/// Names with our prefix that are flags or belong to the tests, not settings.
const NOT_SETTINGS: [&str; 3] = ["TRIPLANAR_CONFIG", "TRIPLANAR_TEST_DATA", "TRIPLANAR_REQUIRE_TEST_DATA"];

/// All settings; `config/triplanar.toml` explains each.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "config/triplanar.toml explains every setting, once")]
pub struct Config {
    pub insecure: bool,
    pub storage: Storage,
    pub http: Http,
    pub dimse: Dimse,
    pub intake: Intake,
    pub jobs: Jobs,
    pub memory: Memory,
    pub pipeline: Parameters,
    pub log: Log,
}

/// Section `storage`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "config/triplanar.toml explains every setting, once")]
pub struct Storage {
    pub data_dir: PathBuf,
    pub min_free_bytes: u64,
    pub source_retention_days: u32,
    pub result_retention_days: u32,
    pub set_aside_days: u32,
    pub set_aside_bytes: u64,
}

/// Section `http`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "config/triplanar.toml explains every setting, once")]
pub struct Http {
    pub listen: SocketAddr,
    pub tokens: Vec<Token>,
    pub hosts: Vec<String>,
    pub max_connections: usize,
    pub max_connections_per_address: usize,
    pub trusted_proxies: Vec<Network>,
    pub max_event_streams: usize,
    pub max_event_streams_per_address: usize,
    pub max_upload_bytes: u64,
    pub max_unpacked_bytes: u64,
    pub max_archive_entries: u64,
    pub max_body_bytes: u64,
    pub max_uploads: usize,
    pub max_uploads_per_address: usize,
    pub min_bytes_per_second: u64,
    pub crowded_bytes_per_second: u64,
    #[serde(deserialize_with = "seconds")]
    pub rate_grace: Duration,
    #[serde(deserialize_with = "seconds")]
    pub idle_timeout: Duration,
    pub max_page: u32,
    pub cached_volumes: usize,
}

/// A bearer token, known by its hash alone.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Token {
    /// Whose it is; stands in the log.
    pub name: String,
    /// What it allows.
    pub role: Role,
    /// SHA-256 of the token's text, 64 hex digits.
    pub sha256: String,
}

/// What a token allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Send instances, complete series, start reconstructions.
    Upload,
    /// Series, reconstructions, clouds, reports.
    Read,
    /// Everything.
    Operate,
}

impl Role {
    /// The role's one name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Upload => "upload",
            Self::Read => "read",
            Self::Operate => "operate",
        }
    }
}

/// Section `dimse`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "config/triplanar.toml explains every setting, once")]
pub struct Dimse {
    pub listen: SocketAddr,
    pub ae_title: String,
    pub check_called_ae_title: bool,
    pub calling_ae_titles: Vec<String>,
    pub max_associations: usize,
    pub max_associations_per_peer: usize,
    #[serde(deserialize_with = "seconds")]
    pub gives_way_after: Duration,
    pub crowded_bytes_per_second: u64,
    pub max_waiting: usize,
    pub max_waiting_per_peer: usize,
    pub max_pdu_length: u32,
    #[serde(deserialize_with = "seconds")]
    pub association_timeout: Duration,
    pub min_bytes_per_second: u64,
    #[serde(deserialize_with = "seconds")]
    pub rate_grace: Duration,
    #[serde(deserialize_with = "seconds")]
    pub idle_timeout: Duration,
    #[serde(deserialize_with = "seconds")]
    pub write_timeout: Duration,
}

/// Section `intake`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "config/triplanar.toml explains every setting, once")]
pub struct Intake {
    pub max_instance_bytes: u64,
    pub max_inflated_bytes: u64,
    pub max_series_instances: u64,
    #[serde(deserialize_with = "seconds")]
    pub quiet_after_association: Duration,
    #[serde(deserialize_with = "seconds")]
    pub quiet: Duration,
    pub min_slices: usize,
    pub changed_identity: ChangedIdentity,
}

/// What becomes of an instance that is stored and comes again with another identity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ChangedIdentity {
    /// The new data set replaces the stored one.
    Update,
    /// It is refused.
    Refuse,
}

/// Section `jobs`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "config/triplanar.toml explains every setting, once")]
pub struct Jobs {
    pub workers: usize,
    pub threads: usize,
    pub max_queued: u64,
    pub max_attempts: u32,
    #[serde(deserialize_with = "seconds")]
    pub retry_backoff: Duration,
    #[serde(deserialize_with = "seconds")]
    pub timeout: Duration,
    pub max_voxels: u64,
}

/// Section `memory`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "config/triplanar.toml explains every setting, once")]
pub struct Memory {
    pub budget_bytes: u64,
}

/// The budget where the system does not tell how much memory there is: 2 GiB.
const UNKNOWN_MACHINE: u64 = 2 << 30;

impl Memory {
    /// That of a command, which nobody else's answers share: `budget_bytes`; 0: all that this process
    /// may use.
    #[must_use]
    pub fn of_command(&self) -> memory::Memory {
        match (self.budget_bytes, memory::available_bytes()) {
            (0, None) => memory::Memory::unlimited(),
            (0, Some(bytes)) | (bytes, _) => memory::Memory::new(bytes),
        }
    }

    /// A budget of `budget_bytes`; 0: half of what this process may use.
    #[must_use]
    pub fn budget(&self) -> memory::Memory {
        memory::Memory::new(match self.budget_bytes {
            0 => memory::available_bytes().map_or(UNKNOWN_MACHINE, |bytes| bytes / 2),
            bytes => bytes,
        })
    }
}

/// Section `log`.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "config/triplanar.toml explains every setting, once")]
pub struct Log {
    pub filter: String,
    pub format: LogFormat,
}

/// How log lines look.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LogFormat {
    /// For people.
    Text,
    /// One JSON object a line.
    Json,
}

/// Less memory than this does not hold a volume of 64 slices of 256².
const LEAST_BUDGET: u64 = 64 << 20;

/// What is wrong with the settings, and what to write instead.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file can't be read.
    #[error("the configuration file {path} can't be read: {cause}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// Not TOML.
    #[error("{origin} is not valid TOML: {}", one_line(.cause))]
    NotToml {
        /// File or variable.
        origin: String,
        /// Where and why.
        cause: toml::de::Error,
    },
    /// An unknown name or a value of the wrong kind.
    #[error("the configuration is not valid: {}; config/triplanar.toml lists every setting", one_line(.0))]
    Invalid(toml::de::Error),
    /// A value outside its range.
    #[error("{setting}: {detail}")]
    Range {
        /// The setting.
        setting: &'static str,
        /// What would be right.
        detail: String,
    },
    /// Off loopback without authentication.
    #[error("{0}")]
    Unprotected(String),
}

impl Config {
    /// The compiled-in defaults.
    ///
    /// # Panics
    /// Never: a test holds the compiled-in file valid.
    #[must_use]
    pub fn defaults() -> Self {
        Self::load(None, std::iter::empty()).expect("the compiled-in defaults are valid")
    }

    /// Defaults ← `file` ← those of `environment` that start with `TRIPLANAR_`.
    ///
    /// # Errors
    /// An unreadable file, a name that is no setting, a value outside its range. Whether the
    /// listeners are protected is told by [`Config::check_protection`], after the flags.
    pub fn load(
        file: Option<&Path>,
        environment: impl Iterator<Item = (String, String)>,
    ) -> Result<Self, ConfigError> {
        let mut settings = parse(DEFAULTS, "the compiled-in configuration")?;
        if let Some(path) = file {
            let text = std::fs::read_to_string(path)
                .map_err(|cause| ConfigError::Unreadable { path: path.to_owned(), cause })?;
            merge(&mut settings, parse(&text, &path.display().to_string())?);
        }
        for (name, value) in environment {
            if let Some(path) = setting_path(&name) {
                merge(&mut settings, nested(&path, value_of(&value)));
            }
        }
        let config: Self = settings.try_into().map_err(ConfigError::Invalid)?;
        config.check_ranges()?;
        Ok(config)
    }

    fn check_ranges(&self) -> Result<(), ConfigError> {
        let range = |setting, ok: bool, detail: &str| {
            if ok { Ok(()) } else { Err(ConfigError::Range { setting, detail: detail.to_owned() }) }
        };
        for token in &self.http.tokens {
            let is_hash = token.sha256.len() == 64 && token.sha256.bytes().all(|b| b.is_ascii_hexdigit());
            range("http.tokens", is_hash, "sha256 must be 64 hex digits: `triplanar token` prints the line")?;
        }
        range(
            "http.hosts",
            self.http.hosts.iter().all(|host| HostName::listed(host).is_some()),
            "names or addresses without scheme, port and path, such as \"ct.example.org\"",
        )?;
        let is_ae_title = |title: &str| AeTitle::parse(title).is_some_and(|title| !title.as_str().is_empty());
        range("dimse.ae_title", is_ae_title(&self.dimse.ae_title), AE_TITLE)?;
        range(
            "dimse.calling_ae_titles",
            self.dimse.calling_ae_titles.iter().all(|title| is_ae_title(title)),
            AE_TITLE,
        )?;
        range(
            "dimse.max_pdu_length",
            (4_096..=16_777_216).contains(&self.dimse.max_pdu_length),
            "4096 to 16777216 bytes",
        )?;
        for (setting, value) in [
            ("http.max_connections", self.http.max_connections),
            ("http.max_connections_per_address", self.http.max_connections_per_address),
            ("http.max_event_streams", self.http.max_event_streams),
            ("http.max_event_streams_per_address", self.http.max_event_streams_per_address),
            ("http.max_uploads", self.http.max_uploads),
            ("http.max_uploads_per_address", self.http.max_uploads_per_address),
            ("http.max_page", self.http.max_page as usize),
            ("dimse.max_associations", self.dimse.max_associations),
            ("dimse.max_associations_per_peer", self.dimse.max_associations_per_peer),
            ("dimse.max_waiting", self.dimse.max_waiting),
            ("dimse.max_waiting_per_peer", self.dimse.max_waiting_per_peer),
            ("jobs.workers", self.jobs.workers),
            ("jobs.max_attempts", self.jobs.max_attempts as usize),
            ("intake.min_slices", self.intake.min_slices),
        ] {
            range(setting, value > 0, "must be at least 1")?;
        }
        range(
            "memory.budget_bytes",
            self.memory.budget_bytes == 0 || self.memory.budget_bytes >= LEAST_BUDGET,
            "0 (half of the machine's memory), or at least 67108864 bytes (64 MiB)",
        )?;
        self.pipeline.check().map_err(|e| ConfigError::Range { setting: "pipeline", detail: e.to_string() })
    }

    /// What a series may be at most, from the sections `intake` and `jobs`.
    #[must_use]
    pub fn read_limits(&self) -> ReadLimits {
        ReadLimits {
            max_voxels: self.jobs.max_voxels,
            scan: Limits { max_inflated_bytes: self.intake.max_inflated_bytes, ..Limits::default() },
            min_slices: self.intake.min_slices,
            memory: memory::Memory::unlimited(),
        }
    }

    /// Refuses a listener off loopback without authentication, unless `insecure = true` is
    /// written.
    ///
    /// # Errors
    /// [`ConfigError::Unprotected`], with what to write.
    pub fn check_protection(&self) -> Result<(), ConfigError> {
        if self.insecure {
            return Ok(());
        }
        if !self.http.listen.ip().is_loopback() && self.http.tokens.is_empty() {
            return Err(ConfigError::Unprotected(format!(
                "http.listen = \"{}\" is not loopback and http.tokens is empty: make a token with `triplanar \
                 token --role operate` and write its line under [http], or listen on 127.0.0.1, or write \
                 insecure = true if the network in front protects it",
                self.http.listen
            )));
        }
        if !self.dimse.listen.ip().is_loopback() && self.dimse.calling_ae_titles.is_empty() {
            return Err(ConfigError::Unprotected(format!(
                "dimse.listen = \"{}\" is not loopback and dimse.calling_ae_titles is empty: write \
                 calling_ae_titles = [\"YOUR_PACS\"] under [dimse], or listen on 127.0.0.1, or write insecure = \
                 true if the network in front protects it",
                self.dimse.listen
            )));
        }
        Ok(())
    }
}

/// The error's sentences without its picture of the file.
fn one_line(error: &toml::de::Error) -> String {
    let text = error.to_string();
    let sentences = text.lines().filter(|line| !line.contains('|')).map(str::trim);
    sentences.filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ")
}

fn parse(text: &str, origin: &str) -> Result<toml::Table, ConfigError> {
    text.parse().map_err(|cause| ConfigError::NotToml { origin: origin.to_owned(), cause })
}

/// Lays `over` onto `base`, table by table.
fn merge(base: &mut toml::Table, over: toml::Table) {
    for (key, value) in over {
        match (base.get_mut(&key), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(above)) => merge(below, above),
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}

/// `TRIPLANAR_HTTP__LISTEN` → `["http", "listen"]`.
fn setting_path(name: &str) -> Option<Vec<String>> {
    if NOT_SETTINGS.contains(&name) {
        return None;
    }
    let path = name.strip_prefix(PREFIX)?;
    // What Kubernetes sets for a Service of our name: TRIPLANAR_PORT…, TRIPLANAR_SERVICE_….
    let of_a_service = ["PORT", "SERVICE"]
        .iter()
        .any(|word| path.strip_prefix(word).is_some_and(|rest| rest.is_empty() || rest.starts_with('_')));
    if of_a_service && !path.contains("__") {
        return None;
    }
    Some(path.split("__").map(str::to_lowercase).collect())
}

fn nested(path: &[String], value: toml::Value) -> toml::Table {
    let mut table = toml::Table::new();
    match path {
        [] => {}
        [name] => {
            table.insert(name.clone(), value);
        }
        [section, rest @ ..] => {
            table.insert(section.clone(), toml::Value::Table(nested(rest, value)));
        }
    }
    table
}

/// A TOML value if the text is one, otherwise the text itself.
fn value_of(text: &str) -> toml::Value {
    format!("value = {text}")
        .parse::<toml::Table>()
        .ok()
        .and_then(|mut table| table.remove("value"))
        .unwrap_or_else(|| toml::Value::String(text.to_owned()))
}

fn seconds<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Duration, D::Error> {
    let value = f64::deserialize(deserializer)?;
    if !(0.001..=MAX_SECONDS).contains(&value) {
        let detail = format!("a time must be within 0.001 and {MAX_SECONDS} seconds, not {value}");
        return Err(serde::de::Error::custom(detail));
    }
    Duration::try_from_secs_f64(value).map_err(serde::de::Error::custom)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn env(name: &str, value: &str) -> std::iter::Once<(String, String)> {
        std::iter::once((name.to_owned(), value.to_owned()))
    }

    #[test]
    fn the_compiled_in_file_is_valid_and_holds_the_default_parameters() {
        let config = Config::defaults();
        assert_eq!(config.pipeline, Parameters::default());
        config.check_protection().expect("the defaults listen on loopback");
    }

    #[test]
    fn the_environment_beats_the_file_and_the_file_beats_the_defaults() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("t.toml");
        std::fs::write(&file, "[http]\nlisten = \"127.0.0.1:1\"\n[dimse]\nae_title = \"FILE\"\n").unwrap();
        let config = Config::load(Some(&file), env("TRIPLANAR_DIMSE__AE_TITLE", "ENV")).unwrap();
        assert_eq!(config.http.listen, "127.0.0.1:1".parse().unwrap());
        assert_eq!(config.dimse.ae_title, "ENV");
    }

    #[test]
    fn what_kubernetes_sets_for_a_service_of_our_name_is_no_setting() {
        for name in ["TRIPLANAR_PORT", "TRIPLANAR_PORT_8080_TCP_ADDR", "TRIPLANAR_SERVICE_HOST"] {
            assert_eq!(Config::load(None, env(name, "tcp://10.0.0.1:8080")).unwrap(), Config::defaults());
        }
    }

    #[test]
    fn a_time_that_no_clock_can_hold_is_refused() {
        for value in ["1e19", "0", "-1", "nan"] {
            Config::load(None, env("TRIPLANAR_JOBS__TIMEOUT", value)).unwrap_err();
        }
    }

    #[test]
    fn an_unknown_setting_is_refused() {
        let error = Config::load(None, env("TRIPLANAR_HTTP__LISTNE", "x")).unwrap_err();
        assert!(error.to_string().contains("listne"), "{error}");
        assert_eq!(error.to_string().lines().count(), 1, "{error}");
    }

    #[test]
    fn a_file_that_is_no_toml_is_told_in_one_line_with_the_place() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("t.toml");
        std::fs::write(&file, "[http]\nlisten 1\n").unwrap();
        let error = Config::load(Some(&file), std::iter::empty()).unwrap_err().to_string();
        assert!(error.contains("line 2") && error.lines().count() == 1, "{error}");
    }

    #[test]
    fn off_loopback_without_a_token_says_what_to_write() {
        let config = Config::load(None, env("TRIPLANAR_HTTP__LISTEN", "0.0.0.0:8080")).unwrap();
        let error = config.check_protection().unwrap_err().to_string();
        assert!(error.contains("triplanar token") && error.contains("insecure = true"), "{error}");
    }

    #[test]
    fn off_loopback_without_a_calling_ae_title_says_what_to_write() {
        let config = Config::load(None, env("TRIPLANAR_DIMSE__LISTEN", "0.0.0.0:11112")).unwrap();
        let error = config.check_protection().unwrap_err().to_string();
        assert!(error.contains("calling_ae_titles = [") && error.contains("insecure = true"), "{error}");
    }
}
