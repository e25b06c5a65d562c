//! `triplanar evaluate`: the paper's evaluation of a cloud.

mod source;
mod table;

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{Failed, values};
use crate::evaluation::{Evaluation, evaluate, icp};
use crate::geometry::Frame;

pub(super) use source::{Opened, Source};
pub(super) use table::Table;

/// Measure a cloud against the truth, and against the axial cloud, as the paper does
///
/// Reads .ply, .pcd, .npy, .stl, .obj, .raw and .bin. Distances and coverage are taken as the files
/// are; the RMS after ICP is what CloudCompare gives with the paper's settings.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The cloud (of a mesh: its points)
    #[arg(value_name = "CLOUD")]
    cloud: PathBuf,
    /// The truth: the surface of a mesh, or the points of a cloud
    #[arg(long, value_name = "MESH|CLOUD")]
    truth: PathBuf,
    /// The axial cloud, for unique and additional points
    #[arg(long, value_name = "CLOUD")]
    axial: Option<PathBuf>,
    /// Frame of the cloud and the axial cloud; what their files say, or lps, if not given
    #[arg(long, value_parser = values::frame())]
    frame: Option<Frame>,
    /// Frame of the truth; what its file says, or lps, if not given
    #[arg(long, value_parser = values::frame())]
    truth_frame: Option<Frame>,
    #[command(flatten)]
    registration: Registration,
    #[command(flatten)]
    json: Json,
}

/// How to register.
#[derive(Debug, clap::Args)]
pub(super) struct Registration {
    /// Share of the cloud that overlaps with the truth: the nearest points take part in the ICP
    #[arg(long, value_name = "X", default_value_t = icp::Settings::PAPER.overlap, value_parser = overlap)]
    overlap: f64,
}

impl Registration {
    pub(super) fn settings(&self) -> icp::Settings {
        icp::Settings { overlap: self.overlap, ..icp::Settings::PAPER }
    }
}

fn overlap(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|share| 0.0 < *share && *share <= 1.0);
    share.ok_or_else(|| "a share above 0, at most 1, for example 0.9".to_owned())
}

/// Where the figures go.
#[derive(Debug, clap::Args)]
pub(super) struct Json {
    /// Write all figures as JSON, too; `-` writes them to standard output instead of the table
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
}

impl Json {
    /// Refuses a file that can't be written, or that is one of the inputs, before the work begins.
    pub(super) fn check<'a>(&'a self, inputs: impl IntoIterator<Item = &'a Path>) -> Result<(), Failed> {
        match self.json.as_deref() {
            Some(path) if path.as_os_str() != "-" => {
                super::output::all_differ([path], inputs)?;
                super::output::check(path)
            }
            _ => Ok(()),
        }
    }

    /// Prints the table and writes the figures, as asked for.
    pub(super) fn write(&self, figures: &impl Serialize, table: &Table) -> Result<(), Failed> {
        let mut text = serde_json::to_vec_pretty(figures).map_err(Failed::internal)?;
        text.push(b'\n');
        match self.json.as_deref() {
            Some(path) if path.as_os_str() == "-" => super::output::print(String::from_utf8_lossy(&text)),
            Some(path) => {
                super::output::write(path, &text)?;
                super::output::print(table)
            }
            None => super::output::print(table),
        }
    }
}

/// The JSON document.
#[derive(Serialize)]
struct Document<'a> {
    software: &'static str,
    cloud: &'a Source,
    truth: &'a Source,
    axial: Option<&'a Source>,
    #[serde(flatten)]
    evaluation: &'a Evaluation,
}

pub(super) fn run(args: Args) -> Result<(), Failed> {
    let inputs = [Some(&args.cloud), Some(&args.truth), args.axial.as_ref()];
    args.json.check(inputs.into_iter().flatten().map(PathBuf::as_path))?;
    let cloud = Opened::new(&args.cloud, args.frame)?;
    let truth = Opened::new(&args.truth, args.truth_frame)?;
    let axial = args.axial.as_ref().map(|path| Opened::new(path, args.frame)).transpose()?;
    for other in [&truth].into_iter().chain(&axial) {
        cloud.check_unit(other)?;
    }
    let axial_points = axial.as_ref().map(|axial| axial.shape.points.as_slice());
    let settings = args.registration.settings();
    let evaluation = evaluate(&cloud.shape.points, &truth.shape, axial_points, settings)
        .map_err(|empty| Failed::new(super::Exit::Input, empty))?;
    let document = Document {
        software: crate::SOFTWARE,
        cloud: &cloud.source,
        truth: &truth.source,
        axial: axial.as_ref().map(|axial| &axial.source),
        evaluation: &evaluation,
    };
    let mut table = Table::default();
    table.source("cloud", &cloud.source);
    table.source("truth", &truth.source);
    if let Some(axial) = &axial {
        table.source("axial", &axial.source);
    }
    table.evaluation(&evaluation);
    args.json.write(&document, &table)
}
