//! Clouds: by format, plane and frame.

use axum::extract::State;
use axum::http::{HeaderMap, Method};
use axum::response::Response;
use serde::{Deserialize, Serialize};

use super::{WantedRevision, clinical, off_the_runtime, readable, reconstruction_record, steady};
use crate::cloud::{Format, MaxError};
use crate::error::{Error, Result};
use crate::geometry::{Frame, Plane};
use crate::http::Context;
use crate::http::about::About;
use crate::http::extract::{Parameters, ReconstructionPath, SeriesPath};
use crate::http::media_type::negotiate;
use crate::http::representation::Representation;
use crate::http::stored::{self, As};
use crate::store::{ReconstructionRecord, ReconstructionState};

/// Which cloud of a reconstruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
pub(in crate::http) enum CloudPlane {
    /// The merged one.
    #[default]
    Triplanar,
    /// Of the axial slices alone.
    Axial,
    /// Of the sagittal slices alone.
    Sagittal,
    /// Of the coronal slices alone.
    Coronal,
}

impl CloudPlane {
    fn plane(self) -> Option<Plane> {
        match self {
            Self::Triplanar => None,
            Self::Axial => Some(Plane::Axial),
            Self::Sagittal => Some(Plane::Sagittal),
            Self::Coronal => Some(Plane::Coronal),
        }
    }
}

/// Which cloud, and how it is written.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(in crate::http) struct CloudQuery {
    /// The file format; without it, `Accept` chooses.
    #[param(inline)]
    format: Option<Format>,
    /// The merged cloud, or that of one plane.
    #[serde(default)]
    #[param(inline, required = false)]
    plane: CloudPlane,
    /// The frame of the coordinates.
    #[serde(default)]
    #[param(inline, required = false)]
    frame: Frame,
    /// Only the points whose expected error is at most this, mm; 422 where there is none. Clouds of the
    /// profile `paper` carry no expected errors: 409, `no-expected-errors`.
    #[param(value_type = Option<f32>, minimum = 0.0, maximum = 1000.0)]
    max_error_mm: Option<MaxError>,
}

/// The same of a series.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(in crate::http) struct SeriesCloudQuery {
    /// `current`: 409 with Retry-After unless the clinical reconstruction is of the latest revision.
    #[param(inline)]
    revision: Option<WantedRevision>,
    /// The file format; without it, `Accept` chooses.
    #[param(inline)]
    format: Option<Format>,
    /// The merged cloud, or that of one plane.
    #[serde(default)]
    #[param(inline, required = false)]
    plane: CloudPlane,
    /// The frame of the coordinates.
    #[serde(default)]
    #[param(inline, required = false)]
    frame: Frame,
    /// Only the points whose expected error is at most this, mm. Clouds of the profile `paper` carry no
    /// expected errors: 409, `no-expected-errors`.
    #[param(value_type = Option<f32>, minimum = 0.0, maximum = 1000.0)]
    max_error_mm: Option<MaxError>,
}

/// The cloud of a reconstruction
///
/// Coordinates are mm in the patient frame; PLY and PCD say in comments which. Vertex properties
/// beyond x, y, z: under the profile `precise` `nx`, `ny`, `nz` (outward unit normal in the same frame;
/// in PCD `normal_x` …) and `expected_error_mm` (along the normal); under both `planes` (bit 1 axial, 2
/// sagittal, 4 coronal: the planes whose points the vertex stands for) and `unique` (1: no axial point
/// lies within `unique_distance_mm`). Clouds of `precise` are in level-of-detail order: the first N
/// points are a coarse cloud of the whole.
#[utoipa::path(
    get,
    path = "/v1/reconstructions/{id}/cloud",
    operation_id = "getCloud",
    tag = "Results",
    params(("id" = uuid::Uuid, Path, description = "The reconstruction's id."), CloudQuery),
    responses(
        (status = 200, description = "The cloud.", content(
            (Vec<u8> = "application/x-ply"), (Vec<u8> = "text/x-ply"), (Vec<u8> = "application/x-pcd"),
            (Vec<u8> = "application/octet-stream"), (Vec<u8> = "application/x-npy"),
        ), headers(("ETag" = String, description = "Strong; one for each format, frame, filter and coding."))),
        (status = 206, description = "The part that Range asks for.", content(
            (Vec<u8> = "application/x-ply"), (Vec<u8> = "text/x-ply"), (Vec<u8> = "application/x-pcd"),
            (Vec<u8> = "application/octet-stream"), (Vec<u8> = "application/x-npy"),
        )),
        (status = 304, description = "The client has it: If-None-Match."),
        (status = 404, description = "No such reconstruction."),
        (status = 406, description = "None of the accepted media types is one of ours."),
        (status = 409, description = "The reconstruction has no cloud (yet), or its points no expected errors."),
        (status = 416, description = "The range lies outside."),
        (status = 422, description = "No point is within max_error_mm: `empty-cloud`."),
        (status = 500, description = "The stored result is damaged (`result-damaged`): ask for the same reconstruction again to have it made again. Found while it is sent, the answer ends early and the connection is closed."),
        (status = 503, description = "The memory budget is in use: try again after Retry-After."),
    ),
)]
pub(in crate::http) async fn reconstruction_cloud(
    State(context): State<Context>,
    ReconstructionPath(id): ReconstructionPath,
    Parameters(query): Parameters<CloudQuery>,
    method: Method,
    headers: HeaderMap,
) -> Result<Response> {
    let record = reconstruction_record(&context, id).await?;
    steady(&context, &record.series_instance_uid).await?;
    serve(&context, record, query, method, headers).await
}

/// The clinical cloud of a series
///
/// One request for a navigation system that knows the Series Instance UID. It is that of the
/// reconstruction that the service queued itself for the latest revision, never somebody's experiment,
/// until an operator chooses another (`PUT /v1/series/{series}/clinical-reconstruction`). While a newer
/// revision is at work, or if it has failed, the one before is served: `Triplanar-Newer-Revision` and
/// `Link` say so, and `revision=current` refuses it.
#[utoipa::path(
    get,
    path = "/v1/series/{series}/cloud",
    operation_id = "getLatestCloud",
    tag = "Results",
    params(
        ("series" = crate::dicom::uid::SeriesInstanceUid, Path, description = "Series Instance UID."),
        SeriesCloudQuery
    ),
    responses(
        (status = 200, description = "The cloud.", content(
            (Vec<u8> = "application/x-ply"), (Vec<u8> = "text/x-ply"), (Vec<u8> = "application/x-pcd"),
            (Vec<u8> = "application/octet-stream"), (Vec<u8> = "application/x-npy"),
        ), headers(("ETag" = String, description = "Strong; one for each format, frame, filter and coding."))),
        (status = 206, description = "The part that Range asks for.", content(
            (Vec<u8> = "application/x-ply"), (Vec<u8> = "text/x-ply"), (Vec<u8> = "application/x-pcd"),
            (Vec<u8> = "application/octet-stream"), (Vec<u8> = "application/x-npy"),
        )),
        (status = 304, description = "The client has it: If-None-Match."),
        (status = 404, description = "No such series."),
        (status = 406, description = "None of the accepted media types is one of ours."),
        (status = 409, description = "The series has no cloud (yet), or none of its latest revision, or its points no expected errors."),
        (status = 416, description = "The range lies outside."),
        (status = 422, description = "No point is within max_error_mm: `empty-cloud`."),
        (status = 500, description = "The stored result is damaged (`result-damaged`): ask for the same reconstruction again to have it made again. Found while it is sent, the answer ends early and the connection is closed."),
        (status = 503, description = "The memory budget is in use: try again after Retry-After."),
    ),
)]
pub(in crate::http) async fn latest_cloud(
    State(context): State<Context>,
    SeriesPath(uid): SeriesPath,
    Parameters(query): Parameters<SeriesCloudQuery>,
    method: Method,
    headers: HeaderMap,
) -> Result<Response> {
    let record = clinical(&context, &uid, query.revision).await?;
    let SeriesCloudQuery { revision: _, format, plane, frame, max_error_mm } = query;
    let query = CloudQuery { format, plane, frame, max_error_mm };
    serve(&context, record, query, method, headers).await
}

async fn serve(
    context: &Context,
    record: ReconstructionRecord,
    query: CloudQuery,
    method: Method,
    headers: HeaderMap,
) -> Result<Response> {
    let format = match query.format {
        Some(format) => format,
        None => negotiated(&headers)?,
    };
    if !record.state.has_cloud() {
        return Err(no_cloud(&record));
    }
    let about = About::of(context, &record, &location(&record, &query, format)).await?;
    let file = readable(context, context.store.open_cloud(record.id, query.plane.plane()).await)?;
    let form = As { format, frame: query.frame, max_error: query.max_error_mm };
    let context = context.clone();
    let response = off_the_runtime(move || {
        let representation = Representation {
            bytes: stored::cloud(&context, record.id, file, form)?,
            media_type: format.media_type(),
            file_name: Some(file_name(&record, &query, format)),
            compressible: true,
            vary: "Accept, Accept-Encoding",
        };
        representation.respond(&method, &headers)
    })
    .await?;
    Ok(about.on(response))
}

/// Where these bytes are always found.
fn location(record: &ReconstructionRecord, query: &CloudQuery, format: Format) -> String {
    let plane = query.plane.plane().map_or(String::new(), |plane| format!("&plane={}", plane.name()));
    let frame =
        if query.frame == Frame::Lps { String::new() } else { format!("&frame={}", query.frame.name()) };
    let filter = query.max_error_mm.map_or(String::new(), |mm| format!("&max_error_mm={mm}"));
    format!("/v1/reconstructions/{}/cloud?format={}{plane}{frame}{filter}", record.id, format.name())
}

fn negotiated(headers: &HeaderMap) -> Result<Format> {
    let offered = Format::ALL.map(Format::media_type);
    let chosen = negotiate(headers, &offered).and_then(|index| Format::ALL.get(index).copied());
    chosen.ok_or(Error::NotAcceptable(
        "application/x-ply, text/x-ply, application/x-pcd, application/octet-stream, application/x-npy",
    ))
}

/// What a client can do about a reconstruction without a cloud.
fn no_cloud(record: &ReconstructionRecord) -> Error {
    let detail = match record.state {
        ReconstructionState::Queued | ReconstructionState::Running => {
            "its cloud is served when it has succeeded".to_owned()
        }
        ReconstructionState::Failed => {
            let code = record.error_code.as_deref().unwrap_or("unknown");
            format!("it gave no cloud ({code})")
        }
        _ => "start it again".to_owned(),
    };
    Error::ReconstructionState { state: record.state.name(), detail }
}

/// `triplanar-<id>[-axial][-max-error-0.1mm][-ras].ply`: nothing of a patient in it.
fn file_name(record: &ReconstructionRecord, query: &CloudQuery, format: Format) -> String {
    let plane = query.plane.plane().map_or(String::new(), |plane| format!("-{}", plane.name()));
    let frame = if query.frame == Frame::Lps { String::new() } else { format!("-{}", query.frame.name()) };
    let filter = query.max_error_mm.map_or(String::new(), |mm| format!("-max-error-{mm}mm"));
    format!("triplanar-{}{plane}{filter}{frame}.{}", record.id, format.extension())
}
