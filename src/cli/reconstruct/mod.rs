//! `triplanar reconstruct`: the service's own way from instances to cloud, without the service.

mod choose;
mod destination;
mod summary;
mod thresholds;

use std::path::PathBuf;

use super::inputs::Inputs;
use super::progress::Progress;
use super::{Exit, Failed, Settings, output};
use crate::dicom::uid::SeriesInstanceUid;
use crate::reconstruction::{self, Failure, Report};
use destination::Destination;
use thresholds::Thresholds;

/// Turn the DICOM files of a folder or zip into a cloud, without a service
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Folder (searched through) or zip of DICOM files, or one multi-frame file
    #[arg(value_name = "DIR|ZIP")]
    input: PathBuf,
    #[command(flatten)]
    destination: Destination,
    /// Where the report goes, as JSON, or as CSV if the name ends in .csv
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Series Instance UID, where the input holds several series
    #[arg(long, value_name = "UID")]
    series: Option<SeriesInstanceUid>,
    #[command(flatten)]
    thresholds: Thresholds,
    #[command(flatten)]
    settings: Settings,
}

pub(super) fn run(args: Args) -> Result<(), Failed> {
    let config = args.settings.load()?;
    let parameters = args.thresholds.over(&config.pipeline)?;
    let format = args.destination.format()?;
    args.destination.check(parameters.profile)?;
    let inputs = Inputs::open(&args.input, &config)?;
    for file in &inputs.refused {
        eprintln!("not used: {}: {}: {}", file.name, file.code, file.detail);
    }
    let selected = choose::series(&inputs, args.series.as_ref(), config.intake.min_slices)?;
    let progress = Progress::new(parameters.profile);
    let outcome = reconstruction::run(&selected, &parameters, &config.read_limits(), &progress);
    progress.finish();
    match outcome {
        Ok(mut product) => {
            product.report.unused = selected.unused();
            let kept = args.destination.write(&product, format)?;
            write_report(args.report.as_ref(), &product.report)?;
            summary::print(&product.report);
            if let Some(kept) = kept {
                println!("kept         {kept} points within --max-error-mm");
            }
            println!("cloud        {}", args.destination.path().display());
            Ok(())
        }
        Err(mut failure) => {
            if let Some(report) = &mut failure.report {
                report.unused = selected.unused();
                write_report(args.report.as_ref(), report)?;
                summary::print(report);
            }
            Err(failed(&failure))
        }
    }
}

fn write_report(path: Option<&PathBuf>, report: &Report) -> Result<(), Failed> {
    let Some(path) = path else { return Ok(()) };
    let is_csv = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
    output::write(path, &if is_csv { report.to_csv() } else { report.to_json() })
}

fn failed(failure: &Failure) -> Failed {
    let exit = match failure.code.as_str() {
        // It has got through to the pipeline, and was a volume.
        _ if failure.report.is_some() => Exit::EmptyCloud,
        Failure::UNREADABLE => Exit::Input,
        Failure::CANCELLED => Exit::Internal,
        _ => Exit::Series,
    };
    let mut message = failure.to_string();
    for uid in &failure.instances {
        message.push_str(&format!("\n  instance {uid}"));
    }
    Failed::new(exit, message)
}
