//! The report's file, also of a series from which nothing could be made.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::cli::{Failed, output};
use crate::dicom::uid::SopInstanceUid;
use crate::reconstruction::{Report, UnusedFile};

/// Where the report goes.
#[derive(Debug, clap::Args)]
pub(super) struct ReportFile {
    /// Where the report goes, as JSON, or as CSV if the name ends in .csv; also where there is no cloud
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

/// What is written of a series that never became a volume: `error` as in a [`Report`], and no rows.
#[derive(Debug, Serialize)]
pub(super) struct Unmade<'a> {
    pub(super) software: &'static str,
    pub(super) error: Reason<'a>,
    pub(super) unused: Vec<UnusedFile>,
    pub(super) slices: [(); 0],
}

/// Why there is no cloud.
#[derive(Debug, Serialize)]
pub(super) struct Reason<'a> {
    /// Stable code.
    pub(super) code: &'a str,
    /// What went wrong and what to do next.
    pub(super) detail: &'a str,
    /// The instances that are at fault, if some are.
    pub(super) instances: &'a [SopInstanceUid],
}

impl ReportFile {
    pub(super) fn path(&self) -> Option<&Path> {
        self.report.as_deref()
    }

    /// Writes the report, if it was asked for.
    pub(super) fn write(&self, report: &Report) -> Result<(), Failed> {
        self.as_asked(|| report.to_json(), || report.to_csv())
    }

    /// Writes why there is none.
    pub(super) fn write_unmade(&self, error: Reason<'_>, unused: Vec<UnusedFile>) -> Result<(), Failed> {
        let unmade = Unmade { software: crate::SOFTWARE, error, unused, slices: [] };
        let json = || {
            let mut out = serde_json::to_vec_pretty(&unmade).expect("plain texts");
            out.push(b'\n');
            out
        };
        self.as_asked(json, Report::csv_without_rows)
    }

    fn as_asked(&self, json: impl FnOnce() -> Vec<u8>, csv: impl FnOnce() -> Vec<u8>) -> Result<(), Failed> {
        let Some(path) = &self.report else { return Ok(()) };
        let is_csv = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
        output::write(path, &if is_csv { csv() } else { json() })
    }
}
