//! What the sender of an upload is told.

use axum::Json;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use serde::Serialize;

use super::session::Outcome;
use crate::error::Error;
use crate::http::problem::Problem;
use crate::http::refused::{Refusal, Skipped};
use crate::http::views::{ReconstructionView, SeriesView};

/// An upload was received.
#[derive(Debug, Serialize, utoipa::ToSchema)]
pub(crate) struct UploadAnswer {
    /// How many of what.
    pub instances: InstanceCounts,
    /// The series that the upload's instances belong to.
    pub series: Vec<UploadedSeries>,
    /// Instances that were refused, each with its reason.
    pub refused: Vec<Refusal>,
    /// Files that are no DICOM instances.
    pub skipped: Vec<Skipped>,
}

/// The instances of an upload by outcome.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, utoipa::ToSchema)]
pub(crate) struct InstanceCounts {
    /// Stored now.
    pub stored: u64,
    /// Stored before with the same content.
    pub duplicate: u64,
    /// Refused.
    pub refused: u64,
    /// Files that are no DICOM instances.
    pub skipped: u64,
}

/// A series of an upload.
#[derive(Debug, Serialize, utoipa::ToSchema)]
pub(crate) struct UploadedSeries {
    /// The series as it stands now.
    pub series: SeriesView,
    /// Its latest reconstruction, if it is complete and can be reconstructed.
    pub reconstruction: Option<ReconstructionView>,
}

/// The outcomes of an upload, sorted.
pub(super) struct Tally {
    pub(super) counts: InstanceCounts,
    pub(super) skipped: Vec<Skipped>,
    refused: Vec<Refusal>,
    first_error: Option<Error>,
}

impl Tally {
    pub(super) fn of(outcomes: Vec<Outcome>, skipped: Vec<Skipped>) -> Self {
        let counts = InstanceCounts { skipped: skipped.len() as u64, ..InstanceCounts::default() };
        let mut tally = Self { counts, skipped, refused: Vec::new(), first_error: None };
        for Outcome { name, result, .. } in outcomes {
            match result {
                Ok(receipt) if receipt.duplicate => tally.counts.duplicate += 1,
                Ok(_) => tally.counts.stored += 1,
                Err(error) => {
                    tally.counts.refused += 1;
                    let code = error.mapping().code.to_owned();
                    tally.refused.push(Refusal { name, code, detail: error.to_string() });
                    tally.first_error.get_or_insert(error);
                }
            }
        }
        tally
    }

    /// 202, or the problem if nothing at all was stored.
    pub(super) fn answer(self, series: Vec<UploadedSeries>) -> Response {
        let Self { counts, skipped, refused, first_error } = self;
        if counts.stored + counts.duplicate == 0 {
            let error = first_error.unwrap_or(Error::EmptyUpload);
            let problem = Problem { refused, skipped, ..Problem::of(&error) };
            return problem.respond(&error);
        }
        let answer = UploadAnswer { instances: counts, series, refused, skipped };
        (StatusCode::ACCEPTED, Json(answer)).into_response()
    }
}
