//! `triplanar serve`.

use std::net::SocketAddr;
use std::path::PathBuf;

use super::{Failed, Settings};
use crate::config::Config;

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
    let _config = args.config()?;
    Err(Failed::internal("the service is not part of this build"))
}
