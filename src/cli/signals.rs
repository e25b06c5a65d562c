//! SIGINT and SIGTERM; SIGHUP and SIGXFSZ, which do nothing.

use std::io;

use rustix::process::Signal;
use tokio::signal::unix::{self, SignalKind, signal};

/// The signals that ask the process to end, caught from its making on.
pub(super) struct Signals {
    interrupt: unix::Signal,
    terminate: unix::Signal,
}

impl Signals {
    pub(super) fn new() -> io::Result<Self> {
        let mut hangup = signal(SignalKind::hangup())?;
        // A terminal that goes away, or a rotation of logs, is no reason to stop.
        tokio::spawn(async move {
            while hangup.recv().await.is_some() {
                tracing::info!(
                    "SIGHUP: nothing to do; settings are read at start, logs go to standard error"
                );
            }
        });
        // A file at the limit of its size (`ulimit -f`) is an error of its writer, not the end: once heard, the
        // signal no longer kills.
        let _heard = signal(SignalKind::from_raw(Signal::XFSZ.as_raw()))?;
        Ok(Self { interrupt: signal(SignalKind::interrupt())?, terminate: signal(SignalKind::terminate())? })
    }

    /// Waits for the next of them.
    pub(super) async fn next(&mut self) {
        tokio::select! {
            _ = self.interrupt.recv() => {}
            _ = self.terminate.recv() => {}
        }
    }
}
