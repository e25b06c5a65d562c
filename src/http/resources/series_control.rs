//! What a client can do to a series.

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use serde::{Deserialize, Serialize};

use super::{reconstruction_record, series_record};
use crate::config;
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::{Error, Result};
use crate::http::Context;
use crate::http::extract::{JsonBody, SeriesPath};
use crate::http::upload::UploadedSeries;
use crate::http::views::{ReconstructionView, SeriesView};
use crate::store::{CompleteReason, ReconstructionFilter, ReconstructionState};

/// Whether a series can be said to have so many instances: no more than it may; the limits, if not.
pub(in crate::http) fn check_expected(instances: u64, intake: &config::Intake) -> Result<(), String> {
    let most = intake.max_series_instances;
    if (1..=most).contains(&instances) {
        Ok(())
    } else {
        Err(format!("1 to {most} (intake.max_series_instances)"))
    }
}

/// Rows that are looked through at a time.
const PAGE: u32 = 100;

/// Say that a series is complete
///
/// Its reconstruction with the configured parameters is queued, unless it can't be reconstructed:
/// then `series.unfit_reason` says why. A series that is complete already is left as it is.
#[utoipa::path(
    post,
    path = "/v1/series/{series}/complete",
    operation_id = "completeSeries",
    tag = "Series",
    params(("series" = SeriesInstanceUid, Path, description = "Series Instance UID.")),
    responses(
        (status = 202, description = "The series as it stands now.", body = UploadedSeries),
        (status = 404, description = "No such series."),
    ),
)]
pub(in crate::http) async fn complete_series(
    State(context): State<Context>,
    SeriesPath(uid): SeriesPath,
) -> Result<(StatusCode, Json<UploadedSeries>)> {
    series_record(&context, &uid).await?;
    let reconstruction = match context.intake.complete(&uid, CompleteReason::Explicit).await? {
        Some(id) => Some(ReconstructionView::from(reconstruction_record(&context, id).await?)),
        None => None,
    };
    let series = SeriesView::from(series_record(&context, &uid).await?);
    Ok((StatusCode::ACCEPTED, Json(UploadedSeries { series, reconstruction })))
}

/// How many instances make a series whole.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({ "instances": 145 }))]
pub(crate) struct ExpectedInstances {
    /// Instances of the whole series, at most `intake.max_series_instances`.
    #[schema(minimum = 1)]
    pub instances: u64,
}

/// Say how many instances a series has
///
/// Before or during a push. The series is complete as soon as so many are stored.
#[utoipa::path(
    put,
    path = "/v1/series/{series}/expected-instances",
    operation_id = "expectInstances",
    tag = "Series",
    params(("series" = SeriesInstanceUid, Path, description = "Series Instance UID; it need not be known yet.")),
    request_body(content = ExpectedInstances, content_type = "application/json"),
    responses(
        (status = 200, description = "Noted.", body = ExpectedInstances),
        (status = 408, description = "The body stopped coming."),
        (status = 413, description = "The body is too large."),
        (status = 415, description = "The body is not JSON."),
        (status = 422, description = "The body is not valid."),
    ),
)]
pub(in crate::http) async fn expect_instances(
    State(context): State<Context>,
    SeriesPath(uid): SeriesPath,
    body: JsonBody,
) -> Result<Json<ExpectedInstances>> {
    let expected: ExpectedInstances = body.of()?;
    check_expected(expected.instances, &context.config.intake)
        .map_err(|detail| Error::InvalidBody(format!("instances: {detail}")))?;
    context.intake.expect(&uid, expected.instances).await?;
    Ok(Json(expected))
}

/// Remove a series
///
/// With its instances, reconstructions, clouds and reports. What runs is cancelled.
#[utoipa::path(
    delete,
    path = "/v1/series/{series}",
    operation_id = "deleteSeries",
    tag = "Series",
    params(("series" = SeriesInstanceUid, Path, description = "Series Instance UID.")),
    responses(
        (status = 204, description = "Removed."),
        (status = 404, description = "No such series."),
    ),
)]
pub(in crate::http) async fn delete_series(
    State(context): State<Context>,
    SeriesPath(uid): SeriesPath,
) -> Result<StatusCode> {
    for state in [ReconstructionState::Queued, ReconstructionState::Running] {
        let filter = ReconstructionFilter { series_instance_uid: Some(uid.clone()), state: Some(state) };
        let mut cursor = None;
        loop {
            let page = context.store.list_reconstructions(&filter, cursor.as_deref(), PAGE).await?;
            for record in page.rows {
                context.jobs.cancel(record.id).await?;
            }
            cursor = page.next_cursor;
            if cursor.is_none() {
                break;
            }
        }
    }
    if context.store.delete_series(&uid).await? {
        Ok(StatusCode::NO_CONTENT)
    } else {
        Err(Error::NotFound { what: "series", id: uid.to_string() })
    }
}
