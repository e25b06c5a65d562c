//! Starts all of it, stops all of it.
//!
//! Start: the settings must protect what listens off loopback; both ports are bound; the store
//! takes the data directory (one service at a time) and clears what an earlier process left half
//! done; then workers, timers and doors open. Stop: the doors close and let open associations and
//! requests end, the running job goes back to the queue. Nothing that was acknowledged depends on
//! a stop being graceful.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use tokio::net::TcpListener;
use tokio::task::JoinSet;
use tokio::time::{MissedTickBehavior, interval, timeout};
use tokio_util::sync::CancellationToken;

use crate::config::{Config, ConfigError};
use crate::http::AppState;
use crate::intake::Intake;
use crate::jobs::Jobs;
use crate::store::{OpenError, Store, Swept};
use crate::telemetry::Metrics;
use crate::{crowd, dimse, http};

/// How long open associations, requests and the running job may take to end at a stop.
const GRACE: Duration = Duration::from_secs(20);

/// How often old instances and results are removed.
const SWEEP_INTERVAL: Duration = Duration::from_secs(600);

/// Why the service does not start: one line that says what to do.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The settings.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The data directory.
    #[error(transparent)]
    Store(#[from] OpenError),
    /// A port can't be listened on.
    #[error("{setting} = \"{address}\" can't be listened on: {cause}; free the port or choose another")]
    Listen {
        /// The setting.
        setting: &'static str,
        /// Its value.
        address: SocketAddr,
        /// What the system says.
        cause: std::io::Error,
    },
    /// The system gives no threads.
    #[error("the pipeline's threads can't be started: {0}")]
    Threads(String),
}

/// A running service. Dropped without [`Service::shutdown`], it stops as in a crash.
#[derive(Debug)]
pub struct Service {
    http: SocketAddr,
    dimse: SocketAddr,
    intake: Intake,
    store: Store,
    stop: CancellationToken,
    /// Each gives its name when it ends.
    parts: JoinSet<&'static str>,
}

impl Service {
    /// Starts everything. When it returns, both doors are open.
    ///
    /// # Errors
    /// [`StartError`]; nothing is left running then.
    pub async fn start(mut config: Config) -> Result<Self, StartError> {
        config.check_protection()?;
        crowd::fit(&mut config);
        let (http_listener, http) = listen("http.listen", config.http.listen).await?;
        let (dimse_listener, dimse) = listen("dimse.listen", config.dimse.listen).await?;
        let store = Store::open(&config.storage).await?;
        let metrics = Arc::new(Metrics::new());
        let jobs = Jobs::new(store.clone(), &config, Arc::clone(&metrics))
            .map_err(|error| StartError::Threads(format!("{error:?}")))?;
        let intake = Intake::new(store.clone(), &config, Arc::clone(&metrics), jobs.wakeup(), jobs.memory());

        let stop = CancellationToken::new();
        let mut parts = JoinSet::new();
        jobs.make_again(&config.pipeline).await;
        let (part, token) = (jobs.clone(), stop.clone());
        spawn(&mut parts, "workers", async move { part.run(token).await });
        let (part, token) = (intake.clone(), stop.clone());
        spawn(&mut parts, "timers", async move { part.run_timers(token).await });
        spawn(&mut parts, "the sweep", sweep(store.clone(), stop.clone()));
        let settings = config.dimse.clone();
        let door = dimse::serve(dimse_listener, intake.clone(), settings, Arc::clone(&metrics), stop.clone());
        spawn(&mut parts, "the DICOM listener", door);
        let state = AppState {
            store: store.clone(),
            intake: intake.clone(),
            jobs,
            config: Arc::new(config),
            metrics,
        };
        let door = http::serve(http_listener, state, stop.clone());
        spawn(&mut parts, "the HTTP listener", async move {
            if let Err(error) = door.await {
                tracing::error!(error = ?error, "the HTTP listener failed");
            }
        });
        tracing::info!(%http, %dimse, software = crate::SOFTWARE, "ready");
        Ok(Self { http, dimse, intake, store, stop, parts })
    }

    /// Where HTTP listens.
    #[must_use]
    pub fn http_addr(&self) -> SocketAddr {
        self.http
    }

    /// Where DICOM listens.
    #[must_use]
    pub fn dimse_addr(&self) -> SocketAddr {
        self.dimse
    }

    /// What the service keeps.
    #[must_use]
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// Returns only if a part of the service has ended by itself, which is a fault: its name.
    pub async fn broken(&mut self) -> String {
        match self.parts.join_next().await {
            Some(Ok(name)) => name.to_owned(),
            Some(Err(panic)) => panic.to_string(),
            None => "the service".to_owned(),
        }
    }

    /// Stops gracefully: refuses what is new, lets what has begun end for a while, puts the running
    /// job back. `false` if something did not end in time and was cut off.
    pub async fn shutdown(mut self) -> bool {
        tracing::info!("shutting down");
        self.intake.shut();
        self.stop.cancel();
        let all_ended = async { while self.parts.join_next().await.is_some() {} };
        let in_time = timeout(GRACE, all_ended).await.is_ok();
        if !in_time {
            tracing::warn!("not everything ended in time: it is cut off; the next start takes it up");
        }
        self.parts.shutdown().await;
        self.store.close().await;
        tracing::info!("stopped");
        in_time
    }
}

fn spawn(
    parts: &mut JoinSet<&'static str>,
    name: &'static str,
    part: impl Future<Output = ()> + Send + 'static,
) {
    parts.spawn(async move {
        part.await;
        name
    });
}

async fn listen(setting: &'static str, address: SocketAddr) -> Result<(TcpListener, SocketAddr), StartError> {
    let refused = |cause| StartError::Listen { setting, address, cause };
    let listener = TcpListener::bind(address).await.map_err(refused)?;
    let bound = listener.local_addr().map_err(refused)?;
    Ok((listener, bound))
}

/// Looks after the catalog, and removes what is older than its retention, until `stop`.
async fn sweep(store: Store, stop: CancellationToken) {
    let mut rounds = interval(SWEEP_INTERVAL);
    rounds.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            () = stop.cancelled() => return,
            _ = rounds.tick() => {}
        }
        // Also where nobody asks for readiness a damaged catalog takes no instance for long.
        store.ready().await;
        if store.check_catalog().is_err() {
            continue;
        }
        match store.sweep(jiff::Timestamp::now().as_millisecond()).await {
            Ok(swept) if swept != Swept::default() => tracing::info!(
                series = swept.series,
                reconstructions = swept.reconstructions,
                "removed what was older than its retention"
            ),
            Ok(_) => {}
            Err(error) => {
                tracing::error!(error = ?error, "what is older than its retention can't be removed")
            }
        }
    }
}
