//! Which series are there.

use axum::Json;
use axum::extract::State;
use serde::Deserialize;

use super::{checked_cursor, clinical, doubts, page_limit, series_record, unfit_detail};
use crate::dicom::uid::StudyInstanceUid;
use crate::error::{Error, Result};
use crate::http::Context;
use crate::http::extract::{Parameters, SeriesPath};
use crate::http::views::{HistoryView, PageView, ReconstructionView, RefusedView, SeriesDetail, SeriesView};
use crate::store::{ReconstructionFilter, SeriesFilter, SeriesState};

/// Refuses what no stored value can be (PS3.5 section 6.2: LO, SH).
fn checked_length(name: &str, text: Option<&str>, most: usize) -> Result<()> {
    if text.is_some_and(|text| text.chars().count() > most) {
        let detail = format!("at most {most} characters");
        return Err(Error::InvalidParameter { name: name.to_owned(), detail });
    }
    Ok(())
}

/// Which series, and which page of them.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(in crate::http) struct SeriesQuery {
    /// Exactly this Patient ID (0010,0020).
    #[serde(rename = "PatientID")]
    #[param(max_length = 64, example = "PHANTOM-4")]
    patient_id: Option<String>,
    /// Exactly this Accession Number (0008,0050).
    #[serde(rename = "AccessionNumber")]
    #[param(max_length = 16, example = "A0001")]
    accession_number: Option<String>,
    /// Of this study (0020,000D).
    #[serde(rename = "StudyInstanceUID")]
    #[param(
        value_type = Option<String>, max_length = 64, pattern = r"^[0-9]+(\.[0-9]+)*$",
        example = "1.2.826.0.1.3680043.10.9999.5.1"
    )]
    study_instance_uid: Option<StudyInstanceUid>,
    /// In this state.
    #[param(inline)]
    state: Option<SeriesState>,
    /// `next_cursor` of the page before.
    #[param(max_length = 200)]
    cursor: Option<String>,
    /// Rows of this page; the most that the service gives by default.
    #[param(minimum = 1, maximum = 200, example = 50)]
    limit: Option<u32>,
}

/// List series
///
/// Newest first, in pages.
#[utoipa::path(
    get,
    path = "/v1/series",
    operation_id = "listSeries",
    tag = "Series",
    params(SeriesQuery),
    responses((status = 200, description = "One page.", body = PageView<SeriesView>)),
)]
pub(in crate::http) async fn list_series(
    State(context): State<Context>,
    Parameters(query): Parameters<SeriesQuery>,
) -> Result<Json<PageView<SeriesView>>> {
    let limit = page_limit(&context, query.limit)?;
    checked_length("PatientID", query.patient_id.as_deref(), 64)?;
    checked_length("AccessionNumber", query.accession_number.as_deref(), 16)?;
    let filter = SeriesFilter {
        patient_id: query.patient_id,
        accession_number: query.accession_number,
        study_instance_uid: query.study_instance_uid,
        state: query.state,
    };
    let cursor = checked_cursor(query.cursor.as_deref())?;
    let page = context.store.list_series(&filter, cursor, limit).await?;
    Ok(Json(PageView::from(page)))
}

/// One series
///
/// Its state, its latest reconstruction, and the instances that were refused.
#[utoipa::path(
    get,
    path = "/v1/series/{series}",
    operation_id = "getSeries",
    tag = "Series",
    params(("series" = crate::dicom::uid::SeriesInstanceUid, Path, description = "Series Instance UID.")),
    responses(
        (status = 200, description = "The series.", body = SeriesDetail),
        (status = 404, description = "No such series."),
    ),
)]
pub(in crate::http) async fn get_series(
    State(context): State<Context>,
    SeriesPath(uid): SeriesPath,
) -> Result<Json<SeriesDetail>> {
    let series = series_record(&context, &uid).await?;
    let filter = ReconstructionFilter { series_instance_uid: Some(uid.clone()), state: None };
    let latest = context.store.list_reconstructions(&filter, None, 1).await?.rows.pop();
    let refused = context.store.refused(&uid).await?;
    let doubt_details = doubts::view(&context, &series, &refused).await?;
    let clinical = clinical::view(&context, &series).await?;
    let unfit_detail = match series.unfit_reason {
        Some(_) => unfit_detail(&context, &uid).await?,
        None => None,
    };
    Ok(Json(SeriesDetail {
        series: SeriesView::from(series),
        unfit_detail,
        reconstruction: latest.map(ReconstructionView::from),
        clinical,
        doubt_details,
        refused: refused.into_iter().map(RefusedView::from).collect(),
        history: HistoryView::all(
            context.store.identity_changes(&uid).await?,
            context.store.attribute_changes(&uid).await?,
        ),
    }))
}
