//! `triplanar compare`: two clouds or meshes against each other.

use std::path::PathBuf;

use serde::Serialize;

use super::evaluate::{Json, Opened, Registration, Source, Table};
use super::{Exit, Failed, values};
use crate::evaluation::{Comparison, Direction, compare};
use crate::geometry::Frame;

/// Compare two clouds or meshes: distances, coverage and unique points both ways, RMS after ICP
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The first cloud or mesh; ICP moves its points
    a: PathBuf,
    /// The second cloud or mesh
    b: PathBuf,
    /// Frame of the first; what its file says, or lps, if not given
    #[arg(long, value_parser = values::frame())]
    frame_a: Option<Frame>,
    /// Frame of the second; what its file says, or lps, if not given
    #[arg(long, value_parser = values::frame())]
    frame_b: Option<Frame>,
    #[command(flatten)]
    registration: Registration,
    #[command(flatten)]
    json: Json,
}

/// The JSON document.
#[derive(Serialize)]
struct Document<'a> {
    software: &'static str,
    a: &'a Source,
    b: &'a Source,
    #[serde(flatten)]
    comparison: &'a Comparison,
}

pub(super) fn run(args: Args) -> Result<(), Failed> {
    args.json.check([args.a.as_path(), args.b.as_path()])?;
    let a = Opened::new(&args.a, args.frame_a)?;
    let b = Opened::new(&args.b, args.frame_b)?;
    a.check_unit(&b)?;
    let comparison = compare(&a.shape, &b.shape, args.registration.settings())
        .map_err(|empty| Failed::new(Exit::Input, empty))?;
    let document =
        Document { software: crate::SOFTWARE, a: &a.source, b: &b.source, comparison: &comparison };
    let mut table = Table::default();
    table.source("A", &a.source);
    table.source("B", &b.source);
    direction(&mut table, "A to B", &comparison.a_to_b);
    direction(&mut table, "B to A", &comparison.b_to_a);
    table.line("Hausdorff", format!("{:.3} mm", comparison.hausdorff_mm));
    table.registration(comparison.registration.as_ref());
    args.json.write(&document, &table)
}

fn direction(table: &mut Table, name: &str, direction: &Direction) {
    let (from, to) = name.split_once(" to ").unwrap_or((name, ""));
    table.distances(name, &direction.distances, direction.sign, to);
    table.coverage(format!("{to} covered by {from}"), &direction.coverage);
    table.unique(format!("unique in {from}"), &direction.unique);
}
