//! `triplanar reconstruct`: the service's own way from instances to cloud, without the service.

mod choose;
mod destination;
mod dump;
mod report;
mod summary;
mod thresholds;

use std::path::PathBuf;

use super::inputs::{Inputs, Selected};
use super::progress::Progress;
use super::{Exit, Failed, Settings, output};
use crate::cloud::Format;
use crate::dicom::series::ReadLimits;
use crate::dicom::uid::SeriesInstanceUid;
use crate::reconstruction::{self, Failure, Product};
use destination::{Destination, Written};
use dump::Dump;
use report::{Reason, ReportFile};
use summary::Summary;
use thresholds::Thresholds;

/// Turn the DICOM files of a folder or zip into a cloud, without a service
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Folder (searched through) or zip of DICOM files, or one multi-frame file
    #[arg(value_name = "DIR|ZIP")]
    input: PathBuf,
    #[command(flatten)]
    destination: Destination,
    #[command(flatten)]
    report: ReportFile,
    #[command(flatten)]
    dump: Dump,
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
    let outputs = || [Some(args.destination.path()), args.report.path()].into_iter().flatten();
    output::all_differ(outputs(), [args.input.as_path()])?;
    outputs().try_for_each(output::check)?;
    args.dump.check(parameters.profile)?;
    let inputs = Inputs::open(&args.input, &config).inspect_err(|failed| {
        let reason = Reason { code: Failure::UNREADABLE, detail: &failed.message, instances: &[] };
        // The failure itself matters more than where it could not be told.
        if let Err(untold) = args.report.write_unmade(reason, Vec::new()) {
            output::tell(format_args!("triplanar: {untold}"));
        }
    })?;
    for file in &inputs.refused {
        output::tell(format_args!("not used: {}: {}: {}", file.name, file.code, file.detail));
    }
    let selected = match choose::series(&inputs, args.series.as_ref(), config.intake.min_slices) {
        Ok(selected) => selected,
        Err(choose::Refused { code, failed }) => {
            if let Some(code) = code {
                let reason = Reason { code, detail: &failed.message, instances: &[] };
                args.report.write_unmade(reason, inputs.refused)?;
            }
            return Err(failed);
        }
    };
    let progress = Progress::new(parameters.profile);
    let limits = ReadLimits { memory: config.memory.of_command(), ..config.read_limits() };
    let dumping = args.dump.watch(&progress);
    let outcome = reconstruction::run(&selected, &parameters, &limits, &dumping);
    progress.finish();
    let dumped = dumping.finish();
    match outcome {
        Ok(mut product) => {
            product.report.unused = selected.unused();
            args.finish(&product, format)?;
            dumped
        }
        Err(failure) => {
            let failed = args.no_cloud(failure, &selected);
            // The failure itself matters more than a file of its stages.
            if let Err(undumped) = dumped {
                output::tell(format_args!("triplanar: {undumped}"));
            }
            Err(failed)
        }
    }
}

impl Args {
    /// Report, cloud and summary of a reconstruction that succeeded.
    fn finish(&self, product: &Product, format: Format) -> Result<(), Failed> {
        // First: it tells why the cloud is as it is, even one that can't be written.
        self.report.write(&product.report)?;
        let written = self.destination.write(product, format);
        output::print(Summary { report: &product.report, plane: self.destination.plane() })?;
        match written? {
            Written::Whole => {}
            Written::Filtered(kept) => {
                output::print(format_args!("kept         {kept} points within --max-error-mm\n"))?;
            }
        }
        output::print(format_args!("cloud        {}\n", self.destination.path().display()))
    }

    /// The report of a reconstruction that gave no cloud, and what to say of it.
    fn no_cloud(&self, mut failure: Failure, selected: &Selected<'_>) -> Failed {
        let failed = failed(&failure);
        let told = match &mut failure.report {
            Some(report) => {
                report.unused = selected.unused();
                let summary = Summary { report, plane: self.destination.plane() };
                self.report.write(report).and_then(|()| output::print(summary))
            }
            None => {
                let Failure { code, detail, instances, .. } = &failure;
                self.report.write_unmade(Reason { code, detail, instances }, selected.unused())
            }
        };
        // The failure itself matters more than where it could not be told.
        if let Err(untold) = told {
            output::tell(format_args!("triplanar: {untold}"));
        }
        failed
    }
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
