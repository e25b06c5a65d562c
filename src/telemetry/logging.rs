//! The log: one line an event on standard error.

use std::io::IsTerminal;

use tracing::Subscriber;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::MakeWriter;
use tracing_subscriber::fmt::format::{DefaultFields, JsonFields, format};

use super::escape::Escaped;
use crate::config::{Log, LogFormat};

/// The log can't be set up.
#[derive(Debug, thiserror::Error)]
pub enum LoggingError {
    /// `log.filter` can't be read.
    #[error("log.filter: {0}; write a level (error, warn, info, debug, trace) or module=level,…")]
    Filter(#[from] tracing_subscriber::filter::ParseError),
    /// There is a log already in this process.
    #[error("the log was set up before: {0}")]
    Twice(#[from] tracing::subscriber::SetGlobalDefaultError),
}

/// Sends the process's log to standard error as the settings say, panics included.
///
/// # Errors
/// A filter that can't be read, a log that is set up already.
pub fn init_logging(log: &Log) -> Result<(), LoggingError> {
    // Not with records of the crate `log`: what decoders tell there is heard where they are called.
    tracing::subscriber::set_global_default(lines(log, std::io::stderr, std::io::stderr().is_terminal())?)?;
    std::panic::set_hook(Box::new(|panic| {
        let message = panic.payload_as_str().unwrap_or("no message");
        let place = panic.location().map(ToString::to_string);
        tracing::error!(place, "a thread panicked: {message}");
    }));
    Ok(())
}

/// What writes the lines. What stands in a field or a text is escaped in this one place.
fn lines<W>(
    log: &Log,
    writer: W,
    colours: bool,
) -> Result<Box<dyn Subscriber + Send + Sync>, tracing_subscriber::filter::ParseError>
where
    W: for<'any> MakeWriter<'any> + Send + Sync + 'static,
{
    let filter = EnvFilter::builder().parse(&log.filter)?;
    // A line that can't be written is lost: to tell of that on standard error would panic, and a full disk or a
    // terminal that is gone is no reason to end.
    let lines = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(writer)
        .with_ansi(colours)
        .log_internal_errors(false);
    Ok(match log.format {
        LogFormat::Text => Box::new(lines.fmt_fields(Escaped(DefaultFields::new())).finish()),
        LogFormat::Json => Box::new(
            lines
                .with_ansi(false)
                .fmt_fields(JsonFields::new())
                .event_format(Escaped(format().json().flatten_event(true)))
                .finish(),
        ),
    })
}

#[cfg(test)]
mod tests {
    use std::io;
    use std::sync::{Arc, Mutex};

    use super::*;

    #[test]
    fn a_filter_that_cannot_be_read_says_what_to_write() {
        let log = Log { filter: "triplanar=loud".into(), format: LogFormat::Text };
        let error = init_logging(&log).unwrap_err().to_string();
        assert!(error.starts_with("log.filter") && error.contains("module=level"), "{error}");
    }

    #[derive(Clone, Default)]
    struct Kept(Arc<Mutex<Vec<u8>>>);

    impl io::Write for Kept {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().extend(bytes);
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// The lines of events whose fields, span and text hold what a sender wrote.
    fn logged(format: LogFormat, text: &str) -> String {
        let kept = Kept::default();
        let writer = kept.clone();
        let lines = lines(&Log { filter: "info".into(), format }, move || writer.clone(), false).unwrap();
        tracing::subscriber::with_default(lines, || {
            let span = tracing::info_span!("request", name = %text);
            span.in_scope(|| tracing::warn!(plain = text, shown = %text, debug = ?text, "said {text}"));
        });
        let bytes = kept.0.lock().unwrap().clone();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn a_line_that_cannot_be_written_is_no_panic() {
        struct Full;
        impl io::Write for Full {
            fn write(&mut self, _: &[u8]) -> io::Result<usize> {
                Err(io::ErrorKind::StorageFull.into())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        for format in [LogFormat::Text, LogFormat::Json] {
            let lines = lines(&Log { filter: "info".into(), format }, || Full, false).unwrap();
            tracing::subscriber::with_default(lines, || tracing::error!("lost"));
        }
    }

    #[test]
    fn what_a_sender_wrote_stays_on_its_line_and_colours_nothing() {
        let hostile = "x\n2026-01-01T00:00:00Z  INFO forged\r\u{1b}[2J\u{9b}31m\u{202e}\u{2028}\u{7f}y";
        for format in [LogFormat::Text, LogFormat::Json] {
            let line = logged(format, hostile);
            assert_eq!(line.lines().count(), 1, "{line:?}");
            let body = line.strip_suffix('\n').expect("a line");
            assert!(!body.chars().any(char::is_control), "{line:?}");
            assert!(!body.contains(['\u{202e}', '\u{2028}']), "{line:?}");
            if format == LogFormat::Json {
                let value: serde_json::Value = serde_json::from_str(body).expect("JSON");
                assert_eq!((&value["plain"], &value["shown"]), (&hostile.into(), &hostile.into()));
            }
        }
        assert!(logged(LogFormat::Text, "Zoë 漢").contains("said Zoë 漢"));
    }
}
