//! Where a subcommand gets its configuration from.

use std::path::PathBuf;

use super::Failed;
use crate::config::Config;

/// The flag that names the configuration file.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Settings {
    /// Configuration file; `config/triplanar.toml` of the source explains every setting
    #[arg(long, value_name = "FILE", env = "TRIPLANAR_CONFIG")]
    pub config: Option<PathBuf>,
}

impl Settings {
    /// Defaults ← file ← environment.
    ///
    /// # Errors
    /// What is wrong with the settings.
    pub fn load(&self) -> Result<Config, Failed> {
        // A variable that is no UTF-8 is none of ours: all settings are ASCII.
        let environment = std::env::vars_os()
            .filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)));
        Config::load(self.config.as_deref(), environment).map_err(Failed::usage)
    }
}
