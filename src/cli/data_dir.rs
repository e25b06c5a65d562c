//! The data directory that a command works on.

use std::path::PathBuf;

use super::{Failed, Settings};
use crate::config::Storage;

/// The flags that name it.
#[derive(Debug, clap::Args)]
pub(super) struct DataDir {
    #[command(flatten)]
    settings: Settings,
    /// The data directory (setting storage.data_dir)
    #[arg(long, value_name = "DIR")]
    data_dir: Option<PathBuf>,
}

impl DataDir {
    /// The settings of the storage in it.
    ///
    /// # Errors
    /// What is wrong with the settings.
    pub(super) fn storage(self) -> Result<Storage, Failed> {
        let mut storage = self.settings.load()?.storage;
        storage.data_dir = self.data_dir.unwrap_or(storage.data_dir);
        Ok(storage)
    }
}
