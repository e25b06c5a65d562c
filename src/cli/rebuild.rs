//! `triplanar rebuild`.

use tokio::runtime::Runtime;

use super::Failed;
use super::data_dir::DataDir;
use crate::store::{Rebuilt, Store};

/// Make a new catalog from the files of a data directory whose catalog was lost
///
/// The service must be stopped. A former catalog is moved to set-aside/. What no file holds is
/// listed.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    data_dir: DataDir,
    /// Also if the present catalog can be opened and is not empty
    #[arg(long)]
    replace: bool,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: Args) -> Result<(), Failed> {
    let config = args.data_dir.storage()?;
    let runtime = Runtime::new().map_err(Failed::internal)?;
    let rebuilt = runtime.block_on(Store::rebuild(&config, args.replace)).map_err(Failed::internal)?;
    if args.json {
        println!("{}", serde_json::to_string_pretty(&rebuilt).map_err(Failed::internal)?);
    } else {
        print(&rebuilt);
    }
    Ok(())
}

fn print(rebuilt: &Rebuilt) {
    let blobs = &rebuilt.blobs;
    println!(
        "{} series with {} instances, {} reconstructions",
        rebuilt.series, blobs.instances, rebuilt.reconstructions
    );
    println!(
        "Series without a reconstruction of all their instances get one after the quiet time, when the service runs."
    );
    if let Some(former) = &rebuilt.former_catalog {
        println!("The former catalog is now set-aside/{former}.");
    }
    if blobs.unsealed_instances > 0 {
        println!(
            "{} of the instances were stored by release 0.1, whose files do not tell whether they are what was received.",
            blobs.unsealed_instances
        );
    }
    for path in &blobs.from_reports {
        println!("entered as far as its report tells: {path}");
    }
    for damaged in &blobs.damaged_results {
        println!("damaged, ask for this reconstruction again: {damaged}");
    }
    for path in &blobs.unread_choices {
        println!("an operator's choice can't be read, look which cloud is the clinical one: {path}");
    }
    for blob in &blobs.set_aside {
        println!("set aside: set-aside/{}: {}", blob.path, blob.reason);
    }
    println!("What can't come back:");
    for lost in rebuilt.lost {
        println!("  - {lost}");
    }
}
