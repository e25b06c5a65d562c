//! The whole way from the instances of a series to clouds and report, without a service: what
//! `triplanar reconstruct` and the service's worker both call, so that they give the same bytes.

mod failure;
pub mod pictures;
mod report;
mod run;
mod summary;
mod table;

pub use failure::Failure;
pub use report::{Identity, RefusedInstance, Report, ReportError, ReportRow, UnusedFile, VolumeSummary};
pub use run::{run, run_with_pictures};
pub use summary::PlaneSummary;

use crate::geometry::Plane;

/// What a successful reconstruction leaves behind.
#[derive(Debug, Clone)]
pub struct Product {
    /// The merged cloud (`None`), then each plane's own, in the order of [`Plane::ALL`]: binary
    /// PLY in LPS mm.
    pub clouds: [(Option<Plane>, Vec<u8>); 4],
    /// The report.
    pub report: Report,
    /// What its slices' pictures are drawn from ([`pictures`]), where that was asked for.
    pub pictures: Option<Vec<u8>>,
}
