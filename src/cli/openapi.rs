//! `triplanar openapi`.

use super::{Failed, output};

/// Print the OpenAPI description of the HTTP API
#[derive(Debug, clap::Args)]
pub(super) struct Args {}

pub(super) fn run(_: Args) -> Result<(), Failed> {
    output::print(crate::http::openapi_json())
}
