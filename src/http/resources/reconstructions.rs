//! Reconstructions: asked for, listed, looked at, removed.

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use axum::http::header::LOCATION;
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use serde_json::Value;

use super::{checked_cursor, page_limit, reconstruction_record};
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::{Error, Result};
use crate::http::Context;
use crate::http::extract::Parameters as Query;
use crate::http::extract::{JsonBody, ReconstructionPath, SeriesPath};
use crate::http::views::{PageView, ReconstructionView};
use crate::pipeline::Parameters;
use crate::store::{ReconstructionFilter, ReconstructionState};

/// Reconstruct a series with other parameters
///
/// Parameters that the body leaves out keep the service's configured values; no body at all asks
/// for those alone. The same parameters on the same instances are the same reconstruction: asked
/// for again, it is given back as it stands.
#[utoipa::path(
    post,
    path = "/v1/series/{series}/reconstructions",
    operation_id = "startReconstruction",
    tag = "Reconstructions",
    params(("series" = SeriesInstanceUid, Path, description = "Series Instance UID.")),
    request_body(content = Option<Parameters>, content_type = "application/json"),
    responses(
        (status = 202, description = "Queued, or there already.", body = ReconstructionView,
         headers(("Location" = String, description = "Path of the reconstruction."))),
        (status = 404, description = "No such series."),
        (status = 408, description = "The body stopped coming."),
        (status = 409, description = "The series is not complete, or can't be reconstructed."),
        (status = 410, description = "The source instances are no longer stored."),
        (status = 413, description = "The body is too large."),
        (status = 415, description = "The body is not JSON."),
        (status = 422, description = "A parameter is unknown, outside its range, or changed without an effect under the profile."),
    ),
)]
pub(in crate::http) async fn start_reconstruction(
    State(context): State<Context>,
    SeriesPath(uid): SeriesPath,
    body: JsonBody,
) -> Result<Response> {
    let parameters = merged(&context.config.pipeline, body.0)?;
    let own = parameters == context.config.pipeline;
    let (record, _newly_made) = context.jobs.submit(&uid, parameters).await?;
    if own {
        context.store.take_for_clinical(&record).await?;
    }
    let view = ReconstructionView::from(record);
    let location = view.links.itself.clone();
    Ok((StatusCode::ACCEPTED, [(LOCATION, location)], Json(view)).into_response())
}

/// The configured parameters with those of the body in their place.
fn merged(configured: &Parameters, body: Option<Value>) -> Result<Parameters> {
    let Some(body) = body.filter(|body| !body.is_null()) else { return Ok(configured.clone()) };
    let mut all = serde_json::to_value(configured).map_err(Error::internal)?;
    overlay(&mut all, body)?;
    let parameters: Parameters =
        serde_json::from_value(all).map_err(|wrong| Error::InvalidBody(wrong.to_string()))?;
    parameters.check().map_err(|wrong| Error::InvalidBody(wrong.to_string()))?;
    parameters.check_use(configured).map_err(|wrong| Error::InvalidBody(wrong.to_string()))?;
    Ok(parameters)
}

fn overlay(below: &mut Value, above: Value) -> Result<()> {
    match (below, above) {
        (Value::Object(below), Value::Object(above)) => {
            for (name, value) in above {
                overlay(below.entry(name).or_insert(Value::Null), value)?;
            }
        }
        // The library would take a list for an object, by the order of its fields.
        (Value::Object(_), other) => {
            return Err(Error::InvalidBody(format!("an object is needed, not {other}")));
        }
        (below, above) => *below = above,
    }
    Ok(())
}

/// Which reconstructions, and which page of them.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(in crate::http) struct ReconstructionQuery {
    /// Of this series.
    #[param(
        value_type = Option<String>, max_length = 64, pattern = r"^[0-9]+(\.[0-9]+)*$",
        example = "1.2.826.0.1.3680043.10.9999.5.2"
    )]
    series: Option<SeriesInstanceUid>,
    /// In this state.
    #[param(inline)]
    state: Option<ReconstructionState>,
    /// `next_cursor` of the page before.
    #[param(max_length = 200)]
    cursor: Option<String>,
    /// Rows of this page; the most that the service gives by default.
    #[param(minimum = 1, maximum = 200, example = 50)]
    limit: Option<u32>,
}

/// List reconstructions
///
/// Newest first, in pages.
#[utoipa::path(
    get,
    path = "/v1/reconstructions",
    operation_id = "listReconstructions",
    tag = "Reconstructions",
    params(ReconstructionQuery),
    responses((status = 200, description = "One page.", body = PageView<ReconstructionView>)),
)]
pub(in crate::http) async fn list_reconstructions(
    State(context): State<Context>,
    Query(query): Query<ReconstructionQuery>,
) -> Result<Json<PageView<ReconstructionView>>> {
    let limit = page_limit(&context, query.limit)?;
    let filter = ReconstructionFilter { series_instance_uid: query.series, state: query.state };
    let cursor = checked_cursor(query.cursor.as_deref())?;
    let page = context.store.list_reconstructions(&filter, cursor, limit).await?;
    Ok(Json(PageView::from(page)))
}

/// One reconstruction
///
/// Its state, how far it is, its parameters, its provenance and its figures.
#[utoipa::path(
    get,
    path = "/v1/reconstructions/{id}",
    operation_id = "getReconstruction",
    tag = "Reconstructions",
    params(("id" = uuid::Uuid, Path, description = "The reconstruction's id.")),
    responses(
        (status = 200, description = "The reconstruction.", body = ReconstructionView),
        (status = 404, description = "No such reconstruction."),
    ),
)]
pub(in crate::http) async fn get_reconstruction(
    State(context): State<Context>,
    ReconstructionPath(id): ReconstructionPath,
) -> Result<Json<ReconstructionView>> {
    let record = reconstruction_record(&context, id).await?;
    Ok(Json(ReconstructionView::from(record)))
}

/// Cancel or remove a reconstruction
///
/// One that waits or runs is cancelled and stays as `cancelled`; one that has ended is removed
/// with its clouds and its report.
#[utoipa::path(
    delete,
    path = "/v1/reconstructions/{id}",
    operation_id = "removeReconstruction",
    tag = "Reconstructions",
    params(("id" = uuid::Uuid, Path, description = "The reconstruction's id.")),
    responses(
        (status = 202, description = "Cancelled.", body = ReconstructionView),
        (status = 204, description = "Removed."),
        (status = 404, description = "No such reconstruction."),
    ),
)]
pub(in crate::http) async fn remove_reconstruction(
    State(context): State<Context>,
    ReconstructionPath(id): ReconstructionPath,
) -> Result<Response> {
    if reconstruction_record(&context, id).await?.state.is_final() {
        return if context.store.delete_reconstruction(id).await? {
            Ok(StatusCode::NO_CONTENT.into_response())
        } else {
            Err(Error::NotFound { what: "reconstruction", id: id.to_string() })
        };
    }
    let record = context.jobs.cancel(id).await?;
    Ok((StatusCode::ACCEPTED, Json(ReconstructionView::from(record))).into_response())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn what_the_body_leaves_out_keeps_the_configured_value() {
        let mut configured = Parameters { leaf_mm: 0.38, ..Parameters::paper() };
        configured.radius_outlier.min_neighbours = 7;
        let body = json!({ "hu_max": 300, "radius_outlier": { "radius_mm": 5.0 } });
        let all = merged(&configured, Some(body)).unwrap();
        assert_eq!((all.leaf_mm, all.hu_max, all.hu_min), (0.38, 300, -200));
        assert_eq!((all.radius_outlier.radius_mm, all.radius_outlier.min_neighbours), (5.0, 7));
        assert_eq!(merged(&configured, None).unwrap(), configured);
    }

    #[test]
    fn unknown_names_null_and_values_out_of_range_are_refused() {
        let refused =
            [json!({ "leaf": 1 }), json!({ "leaf_mm": null }), json!({ "leaf_mm": 0 }), json!([]), json!(1)];
        for body in refused {
            let got = merged(&Parameters::default(), Some(body.clone()));
            assert!(matches!(got, Err(Error::InvalidBody(_))), "{body}: {got:?}");
        }
    }

    #[test]
    fn a_change_without_effect_under_the_profile_is_refused_and_an_echo_is_not() {
        let configured = Parameters::precise();
        let refused = [
            json!({ "hu_min": -300 }),
            json!({ "radius_outlier": { "min_neighbours": 7 } }),
            json!({ "profile": "paper", "quality": { "noise_hu": 60.0 } }),
        ];
        for body in refused {
            let got = merged(&configured, Some(body.clone()));
            assert!(matches!(got, Err(Error::InvalidBody(_))), "{body}: {got:?}");
        }
        let echo = serde_json::to_value(&configured).unwrap();
        assert_eq!(merged(&configured, Some(echo)).unwrap(), configured);
        let paper = merged(&configured, Some(json!({ "profile": "paper", "hu_min": -300 }))).unwrap();
        assert_eq!((paper.profile, paper.hu_min), (crate::pipeline::Profile::Paper, -300));
    }
}
