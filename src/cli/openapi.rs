//! `triplanar openapi`.

use std::io::Write;

use super::Failed;

/// Print the OpenAPI description of the HTTP API
#[derive(Debug, clap::Args)]
pub(super) struct Args {}

pub(super) fn run(_: Args) -> Result<(), Failed> {
    std::io::stdout().write_all(crate::http::openapi_json().as_bytes()).map_err(Failed::internal)
}
