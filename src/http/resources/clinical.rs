//! Which reconstruction of a series is the clinical one.

use axum::extract::State;
use axum::{Extension, Json};
use serde::{Deserialize, Serialize};

use super::series_record;
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::{Error, Result};
use crate::http::Context;
use crate::http::about::Newer;
use crate::http::extract::{JsonBody, SeriesPath};
use crate::http::observe::Caller;
use crate::http::views::{ClinicalChoiceView, ClinicalView};
use crate::store::{ReconstructionId, SeriesRecord};

/// Which is to be the clinical one.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({ "id": "019aa7a0-6f3c-7c1e-9d59-0d1c3a1d1c55" }))]
pub(crate) struct ChosenReconstruction {
    /// A reconstruction of the series that has a cloud; `null`: the one that the service queued itself.
    #[serde(deserialize_with = "Option::deserialize")]
    pub id: Option<ReconstructionId>,
}

/// Choose the clinical reconstruction of a series
///
/// `GET /v1/series/{series}/cloud` and `/report` serve it from now on, until a later revision of the
/// series is complete: then the one that the service queues itself for that revision is the clinical
/// one again. The choice stands in the series' JSON (`clinical.choices`) with the name of the token.
#[utoipa::path(
    put,
    path = "/v1/series/{series}/clinical-reconstruction",
    operation_id = "chooseClinicalReconstruction",
    tag = "Series",
    params(("series" = SeriesInstanceUid, Path, description = "Series Instance UID.")),
    request_body(content = ChosenReconstruction, content_type = "application/json"),
    responses(
        (status = 200, description = "Chosen.", body = ClinicalView),
        (status = 404, description = "No such series, or no such reconstruction of it."),
        (status = 408, description = "The body stopped coming."),
        (status = 409, description = "The reconstruction has no cloud."),
        (status = 413, description = "The body is too large."),
        (status = 415, description = "The body is not JSON."),
        (status = 422, description = "The body is not valid."),
    ),
)]
pub(in crate::http) async fn choose_clinical(
    State(context): State<Context>,
    SeriesPath(uid): SeriesPath,
    caller: Option<Extension<Caller>>,
    body: JsonBody,
) -> Result<Json<ClinicalView>> {
    let ChosenReconstruction { id } = body.of()?;
    let by = caller.map(|Extension(Caller(name))| name);
    context.store.choose_clinical(&uid, id, by.as_deref()).await?;
    let chosen = id.map(|id| id.to_string());
    tracing::info!(series = %uid, reconstruction = chosen, by, "clinical reconstruction chosen");
    let series = series_record(&context, &uid).await?;
    Ok(Json(view(&context, &series).await?))
}

/// What the series' JSON says of it.
pub(super) async fn view(context: &Context, series: &SeriesRecord) -> Result<ClinicalView> {
    let uid = &series.series_instance_uid;
    // One that this version can't read is no reason to tell nothing of its series.
    let clinical = match context.store.clinical(uid).await {
        Err(Error::Unreadable { .. }) => None,
        clinical => clinical?,
    };
    let served = clinical.as_ref().map(|clinical| &clinical.reconstruction);
    let newer = match Newer::than(context, series, served).await {
        Err(Error::Unreadable { .. }) => None,
        newer => newer?,
    };
    let choices = context.store.clinical_choices(uid).await?;
    Ok(ClinicalView {
        chosen: clinical.as_ref().is_some_and(|clinical| clinical.chosen),
        revision: clinical.as_ref().map(|clinical| clinical.reconstruction.revision),
        reconstruction: clinical.map(|clinical| clinical.reconstruction.id),
        newer_revision: newer.map(|newer| newer.state.to_owned()),
        choices: choices.into_iter().map(ClinicalChoiceView::from).collect(),
    })
}
