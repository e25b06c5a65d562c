//! `triplanar phantom`.

use std::path::PathBuf;

use super::Failed;

/// Write a synthetic head CT series whose skin is known exactly
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Where the DICOM files go; made if it does not exist
    dir: PathBuf,
}

pub(super) fn run(args: Args) -> Result<(), Failed> {
    Err(Failed::internal(format!("{} can't be written", args.dir.display())))
}
