//! `triplanar`: arguments and dispatch.

use std::process::ExitCode;

fn main() -> ExitCode {
    triplanar::cli::run()
}
