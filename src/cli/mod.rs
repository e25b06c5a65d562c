//! The command line: one file a subcommand.

mod check;
mod compare;
mod data_dir;
mod demo;
mod evaluate;
mod exit;
mod inputs;
mod openapi;
mod output;
mod phantom;
mod progress;
mod rebuild;
mod reconstruct;
mod render;
mod serve;
mod settings;
mod signals;
mod token;
mod values;
mod verdict;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

pub use exit::{Exit, Failed};
pub use settings::Settings;

/// Head CT in, the patient's skin as a point cloud out.
///
/// Not a medical device: for research and development.
#[derive(Debug, Parser)]
#[command(name = "triplanar", version, after_help = exit::table())]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Serve(serve::Args),
    Demo(demo::Args),
    Reconstruct(reconstruct::Args),
    Phantom(phantom::Args),
    Evaluate(evaluate::Args),
    Compare(compare::Args),
    Render(render::Args),
    Openapi(openapi::Args),
    Token(token::Args),
    Check(check::Args),
    Rebuild(rebuild::Args),
}

/// Reads the arguments of the process, runs the subcommand, prints what failed.
#[must_use]
pub fn run() -> ExitCode {
    let outcome = match Cli::parse().command {
        Command::Serve(args) => serve::run(args),
        Command::Demo(args) => demo::run(args),
        Command::Reconstruct(args) => reconstruct::run(args),
        Command::Phantom(args) => phantom::run(args),
        Command::Evaluate(args) => evaluate::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Render(args) => render::run(args),
        Command::Openapi(args) => openapi::run(args),
        Command::Token(args) => token::run(args),
        Command::Check(args) => check::run(args),
        Command::Rebuild(args) => rebuild::run(args),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failed) => {
            output::tell(format_args!("triplanar: {failed}"));
            ExitCode::from(failed.exit as u8)
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn the_arguments_are_consistent() {
        super::Cli::command().debug_assert();
    }
}
