//! `triplanar rebuild`.

use tokio::runtime::Runtime;

use super::data_dir::DataDir;
use super::{Failed, output};
use crate::store::{MissingInstances, Rebuilt, Store};

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
    output::print(if args.json {
        serde_json::to_string_pretty(&rebuilt).map_err(Failed::internal)? + "\n"
    } else {
        table(&rebuilt)
    })
}

fn table(rebuilt: &Rebuilt) -> String {
    let mut text = String::new();
    let blobs = &rebuilt.blobs;
    text += &format!(
        "{} series with {} instances, {} reconstructions\n",
        rebuilt.series, blobs.instances, rebuilt.reconstructions
    );
    text += "Series without a reconstruction of all their instances get one after the quiet time, when the service runs.\n";
    if let Some(former) = &rebuilt.former_catalog {
        text += &format!("The former catalog is now set-aside/{former}.\n");
    }
    if blobs.unsealed_instances > 0 {
        text += &format!(
            "{} of the instances were stored by release 0.1, whose files do not tell whether they are what was received.\n",
            blobs.unsealed_instances
        );
    }
    for path in &blobs.from_reports {
        text += &format!("entered as far as its report tells: {path}\n");
    }
    for damaged in &blobs.damaged_results {
        text += &format!("damaged, ask for this reconstruction again: {damaged}\n");
    }
    for MissingInstances { series_instance_uid, stored, lost } in &blobs.missing_instances {
        let (count, uids) = (lost.len(), lost.join(", "));
        let what = if *stored == 0 { "removed after their time, or lost" } else { "lost, send them again" };
        text += &format!(
            "{what}: of series {series_instance_uid} {stored} instances are stored, {count} that results were made from are not: {uids}\n"
        );
    }
    for path in &blobs.unread_choices {
        text +=
            &format!("an operator's choice can't be read, look which cloud is the clinical one: {path}\n");
    }
    for blob in &blobs.set_aside {
        text += &format!("set aside: set-aside/{}: {}\n", blob.path, blob.reason);
    }
    text += "What can't come back:\n";
    for lost in rebuilt.lost {
        text += &format!("  - {lost}\n");
    }
    text
}
