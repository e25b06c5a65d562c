//! File descriptors: each connection takes one, and so does each file.

use rustix::process::{Resource, getrlimit, setrlimit};

use crate::config::Config;

/// What the process needs besides connections and their files: catalog, log, timers, libraries.
const BASE: usize = 128;

/// Files of one upload: the archive, and the instances that are made durable at a time.
const OF_UPLOAD: usize = 10;

/// The fewest connections that a limit is lowered to.
const FEWEST: usize = 16;

/// Raises the process's limit of file descriptors as far as it may, and lowers the limits of
/// connections where that is not enough, telling the log: a service out of descriptors can neither
/// accept nor store.
pub(crate) fn fit(config: &mut Config) {
    let mut limit = getrlimit(Resource::Nofile);
    if limit.current != limit.maximum {
        let wanted = rustix::process::Rlimit { current: limit.maximum, ..limit };
        match setrlimit(Resource::Nofile, wanted) {
            Ok(()) => limit.current = wanted.current,
            Err(error) => tracing::warn!(%error, "the limit of open files (RLIMIT_NOFILE) can't be raised"),
        }
    }
    if let Some(limit) = limit.current.and_then(|it| usize::try_from(it).ok()) {
        lower(config, limit);
    }
}

fn lower(config: &mut Config, limit: usize) {
    let files = BASE
        + 2 * config.dimse.max_associations
        + OF_UPLOAD * config.http.max_uploads
        + 4 * config.jobs.workers;
    let room = limit.saturating_sub(files);
    let wanted = config.http.max_connections + config.http.max_event_streams + config.dimse.max_waiting;
    if wanted <= room {
        return;
    }
    let share = |setting: &mut usize| *setting = (*setting * room / wanted).max(FEWEST).min(*setting);
    share(&mut config.http.max_connections);
    share(&mut config.http.max_event_streams);
    share(&mut config.dimse.max_waiting);
    tracing::warn!(
        limit,
        needed = wanted + files,
        http_max_connections = config.http.max_connections,
        http_max_event_streams = config.http.max_event_streams,
        dimse_max_waiting = config.dimse.max_waiting,
        "the limit of open files is too low for the configured limits, which are lowered: raise it (ulimit -n, \
         LimitNOFILE=) or configure less"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_lowered_together_to_what_the_process_may_open() {
        let mut config = Config::defaults();
        lower(&mut config, 1_000_000);
        assert_eq!(config, Config::defaults());
        lower(&mut config, 1_024);
        let defaults = Config::defaults();
        let sum = |it: &Config| it.http.max_connections + it.http.max_event_streams + it.dimse.max_waiting;
        assert!(sum(&config) < 1_024 && sum(&config) > 500 && sum(&config) < sum(&defaults));
        lower(&mut config, 10);
        assert_eq!((config.http.max_connections, config.dimse.max_waiting), (FEWEST, FEWEST));
    }
}
