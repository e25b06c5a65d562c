//! The log: one line an event on standard error.

use std::io::IsTerminal;

use tracing_subscriber::EnvFilter;

use crate::config::{Log, LogFormat};

/// The log can't be set up.
#[derive(Debug, thiserror::Error)]
pub enum LoggingError {
    /// `log.filter` can't be read.
    #[error("log.filter: {0}; write a level (error, warn, info, debug, trace) or module=level,…")]
    Filter(#[from] tracing_subscriber::filter::ParseError),
    /// There is a log already in this process.
    #[error("the log was set up before: {0}")]
    Twice(Box<dyn std::error::Error + Send + Sync>),
}

/// Sends the process's log to standard error as the settings say.
///
/// # Errors
/// A filter that can't be read, a log that is set up already.
pub fn init_logging(log: &Log) -> Result<(), LoggingError> {
    let filter = EnvFilter::builder().parse(&log.filter)?;
    let lines = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal());
    match log.format {
        LogFormat::Text => lines.try_init(),
        LogFormat::Json => lines.json().flatten_event(true).try_init(),
    }
    .map_err(LoggingError::Twice)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_that_cannot_be_read_says_what_to_write() {
        let log = Log { filter: "triplanar=loud".into(), format: LogFormat::Text };
        let error = init_logging(&log).unwrap_err().to_string();
        assert!(error.starts_with("log.filter") && error.contains("module=level"), "{error}");
    }
}
