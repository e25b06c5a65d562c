//! `triplanar openapi`.

use super::Failed;

/// Print the OpenAPI description of the HTTP API
#[derive(Debug, clap::Args)]
pub(super) struct Args {}

pub(super) fn run(_: Args) -> Result<(), Failed> {
    Err(Failed::internal("the HTTP API is not part of this build"))
}
