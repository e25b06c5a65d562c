//! Reports: a row for every slice of every plane, as JSON or CSV.

use axum::extract::State;
use axum::http::{HeaderMap, Method};
use axum::response::Response;
use bytes::Bytes;
use serde::Deserialize;

use super::{WantedRevision, clinical, off_the_runtime, readable, reconstruction_record, steady};
use crate::error::{Error, Result};
use crate::http::Context;
use crate::http::about::About;
use crate::http::extract::{Parameters, ReconstructionPath, SeriesPath};
use crate::http::media_type::negotiate;
use crate::http::representation::Representation;
use crate::jobs::refused_instances;
use crate::reconstruction::Report;
use crate::store::{ReconstructionRecord, report_json};

const JSON: &str = "application/json";
const CSV: &str = "text/csv";

/// The report of a reconstruction
///
/// Counts, warnings, the verdict (profile `precise`) and a row for each slice of each plane:
/// accepted, partly accepted or rejected, with the reasons, what was measured and its limit; under
/// `precise` for each stretch of the contour. A reconstruction that failed in the pipeline has one
/// too. As CSV: the rows alone; `stretches` holds each rejected stretch as
/// `reason:length_mm:measured:limit`, joined by `|`.
#[utoipa::path(
    get,
    path = "/v1/reconstructions/{id}/report",
    operation_id = "getReport",
    tag = "Results",
    params(("id" = uuid::Uuid, Path, description = "The reconstruction's id.")),
    responses(
        (status = 200, description = "The report.", content((Report = "application/json"), (String = "text/csv")),
         headers(("ETag" = String, description = "Strong; one for each media type and coding."))),
        (status = 206, description = "The part that Range asks for.",
         content((String = "application/json"), (String = "text/csv"))),
        (status = 304, description = "The client has it: If-None-Match."),
        (status = 404, description = "No such reconstruction."),
        (status = 406, description = "Neither JSON nor CSV is accepted."),
        (status = 409, description = "The reconstruction has no report (yet)."),
        (status = 416, description = "The range lies outside."),
        (status = 503, description = "The memory budget is in use: try again after Retry-After."),
        (status = 500, description = "The stored result is damaged (`result-damaged`): ask for the same reconstruction again to have it made again."),
    ),
)]
pub(in crate::http) async fn reconstruction_report(
    State(context): State<Context>,
    ReconstructionPath(id): ReconstructionPath,
    method: Method,
    headers: HeaderMap,
) -> Result<Response> {
    let record = reconstruction_record(&context, id).await?;
    steady(&context, &record.series_instance_uid).await?;
    serve(&context, record, method, headers).await
}

/// Which revision of a series.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(in crate::http) struct RevisionQuery {
    /// `current`: 409 with Retry-After unless the clinical reconstruction is of the latest revision.
    #[param(inline)]
    revision: Option<WantedRevision>,
}

/// The clinical report of a series
///
/// Of the same reconstruction as its cloud.
#[utoipa::path(
    get,
    path = "/v1/series/{series}/report",
    operation_id = "getLatestReport",
    tag = "Results",
    params(
        ("series" = crate::dicom::uid::SeriesInstanceUid, Path, description = "Series Instance UID."),
        RevisionQuery
    ),
    responses(
        (status = 200, description = "The report.", content((Report = "application/json"), (String = "text/csv")),
         headers(("ETag" = String, description = "Strong; one for each media type and coding."))),
        (status = 206, description = "The part that Range asks for.",
         content((String = "application/json"), (String = "text/csv"))),
        (status = 304, description = "The client has it: If-None-Match."),
        (status = 404, description = "No such series."),
        (status = 406, description = "Neither JSON nor CSV is accepted."),
        (status = 409, description = "The series has no cloud (yet), or none of its latest revision."),
        (status = 416, description = "The range lies outside."),
        (status = 503, description = "The memory budget is in use: try again after Retry-After."),
        (status = 500, description = "The stored result is damaged (`result-damaged`): ask for the same reconstruction again to have it made again."),
    ),
)]
pub(in crate::http) async fn latest_report(
    State(context): State<Context>,
    SeriesPath(uid): SeriesPath,
    Parameters(query): Parameters<RevisionQuery>,
    method: Method,
    headers: HeaderMap,
) -> Result<Response> {
    let record = clinical(&context, &uid, query.revision).await?;
    serve(&context, record, method, headers).await
}

/// What each byte of a stored report takes while it is read and written again: itself, the rows, the answer
/// and its coding.
const BYTES_A_BYTE: u64 = 6;

async fn serve(
    context: &Context,
    record: ReconstructionRecord,
    method: Method,
    headers: HeaderMap,
) -> Result<Response> {
    let as_csv = match negotiate(&headers, &[JSON, CSV]) {
        Some(0) => false,
        Some(_) => true,
        None => return Err(Error::NotAcceptable("application/json, text/csv")),
    };
    if !record.has_report {
        return Err(no_report(&record));
    }
    let about = About::of(context, &record, &format!("/v1/reconstructions/{}/report", record.id)).await?;
    let stored = readable(context, context.store.report(record.id).await)?;
    let share = context.memory.take(stored.len() as u64 * BYTES_A_BYTE)?;
    // What was refused after the reconstruction had ended belongs to its report too.
    let refused = refused_instances(context.store.refused(&record.series_instance_uid).await?);
    let response = off_the_runtime(move || {
        let _until_it_is_written = share;
        let mut report = report_json::read(&stored).map_err(|why| Error::Unreadable {
            what: "the report of reconstruction",
            id: record.id.to_string(),
            detail: why.to_string(),
        })?;
        report.refused = refused;
        let (bytes, media_type, file_name) = if as_csv {
            let name = format!("triplanar-{}.csv", record.id);
            (report.to_csv(), "text/csv; charset=utf-8; header=present", Some(name))
        } else {
            (report.to_json(), JSON, None)
        };
        let representation = Representation {
            bytes: Bytes::from(bytes),
            media_type,
            file_name,
            compressible: true,
            vary: "Accept, Accept-Encoding",
        };
        representation.respond(&method, &headers)
    })
    .await?;
    Ok(about.on(response))
}

fn no_report(record: &ReconstructionRecord) -> Error {
    let detail = if record.state.is_final() {
        "it ended before the pipeline had anything to report; its error says why"
    } else {
        "its report is served when it has ended"
    };
    Error::ReconstructionState { state: record.state.name(), detail: detail.to_owned() }
}
