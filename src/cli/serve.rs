//! `triplanar serve`.

use std::net::SocketAddr;
use std::path::PathBuf;

use tokio::runtime::Runtime;

use super::signals::Signals;
use super::{Failed, Settings, output};
use crate::config::Config;
use crate::service::{Service, StartError};
use crate::telemetry::init_logging;

/// Run the service: DICOM and HTTP in, clouds out
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    settings: Settings,
    /// Address of the HTTP listener (setting http.listen)
    #[arg(long, value_name = "ADDRESS:PORT")]
    http_listen: Option<SocketAddr>,
    /// Address of the DICOM listener (setting dimse.listen)
    #[arg(long, value_name = "ADDRESS:PORT")]
    dimse_listen: Option<SocketAddr>,
    /// Where everything is kept (setting storage.data_dir)
    #[arg(long, value_name = "DIR")]
    data_dir: Option<PathBuf>,
    /// Listen off loopback without tokens and calling-AE list (setting insecure)
    #[arg(long)]
    insecure: bool,
}

impl Args {
    /// Defaults ← file ← environment ← flags, checked.
    fn config(self) -> Result<Config, Failed> {
        let mut config = self.settings.load()?;
        config.http.listen = self.http_listen.unwrap_or(config.http.listen);
        config.dimse.listen = self.dimse_listen.unwrap_or(config.dimse.listen);
        config.storage.data_dir = self.data_dir.unwrap_or(config.storage.data_dir);
        config.insecure |= self.insecure;
        config.check_protection().map_err(Failed::usage)?;
        Ok(config)
    }
}

pub(super) fn run(args: Args) -> Result<(), Failed> {
    let config = args.config()?;
    init_logging(&config.log).map_err(Failed::usage)?;
    let runtime = Runtime::new().map_err(Failed::internal)?;
    let outcome = runtime.block_on(serve(config));
    // A pipeline that did not stop in time must not hold the process.
    runtime.shutdown_background();
    outcome
}

async fn serve(config: Config) -> Result<(), Failed> {
    // Before anything says ready: a signal that comes early must stop us gracefully too.
    let mut signals = Signals::new().map_err(Failed::internal)?;
    let ae_title = config.dimse.ae_title.clone();
    let mut service = Service::start(config).await.map_err(refusal)?;
    // Scripts wait for this line and read the ports from it; the service works without it.
    let told = output::print(format_args!(
        "{} is ready: http://{} DICOM {ae_title}@{}\n",
        crate::SOFTWARE,
        service.http_addr(),
        service.dimse_addr()
    ));
    if let Err(untold) = told {
        tracing::warn!("{untold}");
    }
    let broken = tokio::select! {
        () = signals.next() => None,
        part = service.broken() => Some(part),
    };
    let shutdown = service.shutdown();
    tokio::select! {
        _in_time = shutdown => {}
        // Asked twice: at once. Nothing acknowledged is lost.
        () = signals.next() => {}
    }
    match broken {
        None => Ok(()),
        Some(part) => Err(Failed::internal(format!("{part} stopped by itself; the log has the cause"))),
    }
}

fn refusal(error: StartError) -> Failed {
    match error {
        StartError::Config(error) => Failed::usage(error),
        other => Failed::internal(other),
    }
}
