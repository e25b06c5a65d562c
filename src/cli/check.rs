//! `triplanar check`.

use tokio::runtime::Runtime;

use super::data_dir::DataDir;
use super::{Exit, Failed, output};
use crate::store::{Checked, Store};

/// Check every file of a data directory against its catalog
///
/// Reads all instances (size, SHA-256) and results, and the catalog itself; changes nothing, and may
/// run beside the service. Exit code 6: something is missing or damaged.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    data_dir: DataDir,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: Args) -> Result<(), Failed> {
    let config = args.data_dir.storage()?;
    let runtime = Runtime::new().map_err(Failed::internal)?;
    let checked = runtime.block_on(Store::check(&config)).map_err(|error| Failed::new(Exit::Input, error))?;
    let text = if args.json {
        serde_json::to_string_pretty(&checked).map_err(Failed::internal)? + "\n"
    } else {
        table(&checked)
    };
    output::print(text)?;
    if !checked.is_damaged() {
        return Ok(());
    }
    let count = checked.problems.iter().filter(|problem| problem.kind != "no_row").count();
    Err(Failed::new(
        Exit::Damaged,
        format!(
            "{count} problems: send damaged or missing instances again while the service runs, ask again for \
             reconstructions whose result is damaged (remove them first), and look for a failing disk"
        ),
    ))
}

fn table(checked: &Checked) -> String {
    let mut text = String::new();
    for problem in &checked.problems {
        let of = problem.of.as_deref().unwrap_or("-");
        text += &format!("{:<10}  {}  {of}  {}\n", problem.kind, problem.path, problem.detail);
    }
    text += &format!(
        "{} instances ({} bytes), {} results, {} files set aside ({} bytes), {} problems{}\n",
        checked.instances,
        checked.bytes,
        checked.results,
        checked.set_aside_files,
        checked.set_aside_bytes,
        checked.problems.len(),
        if checked.in_use { "; a service uses it" } else { "" }
    );
    text
}
