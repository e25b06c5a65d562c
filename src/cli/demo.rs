//! `triplanar demo`.

use super::Failed;

/// Start the service on free ports, send it a synthetic head CT, show what comes out
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// End once the summary is printed, instead of serving until Ctrl-C
    #[arg(long)]
    once: bool,
}

pub(super) fn run(args: Args) -> Result<(), Failed> {
    let _ = args.once;
    Err(Failed::internal("the service is not part of this build"))
}
