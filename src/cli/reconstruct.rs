//! `triplanar reconstruct`.

use std::path::PathBuf;

use super::{Failed, Settings};

/// Turn the DICOM files of a folder or zip into a cloud, without a service
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Folder (searched through) or zip of DICOM files
    #[arg(value_name = "DIR|ZIP")]
    input: PathBuf,
    #[command(flatten)]
    settings: Settings,
}

pub(super) fn run(args: Args) -> Result<(), Failed> {
    let _ = args.settings.load()?;
    Err(Failed::internal(format!("{} can't be reconstructed", args.input.display())))
}
