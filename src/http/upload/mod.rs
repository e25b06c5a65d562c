//! `POST /v1/series`: a series as people have it, in an archive, as single files or by a browser's
//! form. Everything goes to disk as it comes; nothing is held whole.

mod answer;
mod archive;
mod budget;
mod places;
mod receive;
mod session;
mod sniff;
mod source;

use axum::Extension;
use axum::body::Body;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::http::header::CONTENT_LENGTH;
use axum::response::Response;
use serde::Deserialize;

use super::Context;
use super::body::Incoming;
use super::client::Client;
use super::extract::Parameters;
use super::media_type::MediaType;
use super::multipart::Multipart;
use super::refused::{SkipReason, Skipped};
use super::resources::check_expected;
use super::views::{ReconstructionView, SeriesView};
use crate::config;
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::{Error, Result};
use crate::store::{ReconstructionFilter, SenderEnd};
use answer::Tally;
pub(super) use answer::{UploadAnswer, UploadedSeries};
pub(super) use budget::Budget;
pub(super) use places::{Upload, UploadPlace, Uploads};
use receive::Received;
pub(super) use session::{Arriving, Finished, Outcome, Session};
pub(super) use source::Source;

/// What a whole body may call itself; its bytes decide what it is.
const SINGLE_BODIES: [&str; 9] = [
    "application/zip",
    "application/x-zip-compressed",
    "application/x-tar",
    "application/tar",
    "application/gzip",
    "application/x-gzip",
    "application/x-compressed-tar",
    "application/dicom",
    "application/octet-stream",
];

/// What the query of an upload says.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct UploadQuery {
    /// Instances that each series of the upload has in all, at most `intake.max_series_instances`. With it, a
    /// series is complete when it has so many; without it, at the end of the upload (after a single slice: when
    /// nothing more came for the short quiet time).
    #[param(minimum = 1, example = 145)]
    expect: Option<u64>,
}

/// Upload a series
///
/// A zip or tar archive (also gzipped) of DICOM files, one DICOM file, or a browser's form with
/// any of these as its files. What it is, is told from its bytes. Files of an archive that are no
/// DICOM instances are passed over and listed in the answer.
///
/// 202 means that every instance counted as `stored` or `duplicate` is durable. If not one was
/// stored, the answer is the problem of the first refusal, with all of them under `refused`.
#[utoipa::path(
    post,
    path = "/v1/series",
    operation_id = "uploadSeries",
    tag = "Series",
    params(UploadQuery),
    request_body(
        description = "The archive, file or form.",
        content(
            (Vec<u8> = "application/zip"),
            (Vec<u8> = "application/x-tar"),
            (Vec<u8> = "application/gzip"),
            (Vec<u8> = "application/dicom"),
            (Vec<u8> = "application/octet-stream"),
            (UploadForm = "multipart/form-data"),
        ),
    ),
    responses(
        (status = 202, description = "Received and durable.", body = UploadAnswer),
        (status = 400, description = "The archive, form or file can't be read."),
        (status = 408, description = "The body stopped coming."),
        (status = 409, description = "All instances are stored already with other content."),
        (status = 413, description = "Larger than a limit, packed or unpacked."),
        (status = 415, description = "Not a media type, or not a transfer syntax, that is taken here."),
        (status = 422, description = "No instance in it, or none that is acceptable."),
        (status = 507, description = "The disk is nearly full."),
    ),
)]
pub(super) async fn upload_series(
    State(context): State<Context>,
    Parameters(query): Parameters<UploadQuery>,
    Extension(client): Extension<Client>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response> {
    let expect = checked(query.expect, &context.config.intake)?;
    let media_type = MediaType::of_request(&headers);
    let essence = media_type.as_ref().map(|it| it.essence().to_owned());
    let (incoming, place) = admit(&context, &client, &headers, body)?;
    let upload = place.upload();
    let received = match (essence.as_deref(), media_type) {
        (Some("multipart/form-data"), Some(media_type)) => {
            receive::form(&context, upload, Multipart::new(incoming, &media_type)?).await?
        }
        (Some(essence), _) if !SINGLE_BODIES.contains(&essence) => {
            incoming.linger().await;
            return Err(Error::UnsupportedMediaType(
                "Content-Type must be application/zip, application/x-tar, application/gzip, \
                 application/dicom, application/octet-stream or multipart/form-data"
                    .to_owned(),
            ));
        }
        _ => receive::whole(&context, upload, incoming).await?,
    };
    finish(&context, received, expect).await
}

/// What a browser's form holds. Every part with a file name is a file; other parts are ignored.
#[derive(utoipa::ToSchema)]
#[expect(dead_code, reason = "for the API's description alone")]
pub(super) struct UploadForm {
    /// Archives or DICOM files.
    #[schema(value_type = Vec<Vec<u8>>)]
    files: Vec<Vec<u8>>,
}

/// Lets an upload in if there is a place and memory for it.
pub(super) fn admit(
    context: &Context,
    client: &Client,
    headers: &HeaderMap,
    body: Body,
) -> Result<(Incoming, UploadPlace)> {
    let settings = &context.config.http;
    let place = context.uploads.take(client.peer)?;
    let announced = headers.get(CONTENT_LENGTH).and_then(|value| value.to_str().ok()?.parse::<u64>().ok());
    if announced.is_some_and(|length| length > settings.max_upload_bytes) {
        return Err(Error::TooLarge {
            limit_bytes: settings.max_upload_bytes,
            setting: "http.max_upload_bytes",
        });
    }
    Ok((Incoming::upload(body, settings, place.upload().clone()), place))
}

/// Ends the upload: completes its series, and tells what is there now.
async fn finish(context: &Context, received: Received, expect: Option<u64>) -> Result<Response> {
    let Received { session, skipped, .. } = received;
    let Finished { id, outcomes, end } = session.finish().await?;
    for file in skipped.iter().filter(|file| is_lost_instance(file, &outcomes)) {
        tracing::warn!(upload = %id, reason = ?file.reason, "a file is empty or zeroed where its fellows are instances");
        context.intake.lacks(id, None);
    }
    note_expected(context, &outcomes, expect).await?;
    let uids = if end != SenderEnd::UploadEnded || (expect.is_none() && is_lone_slice(&outcomes)) {
        context.intake.sender_ended(id, end).await?;
        series_of(&outcomes).into_iter().collect()
    } else {
        context.intake.upload_ended(id).await?
    };
    let mut series = Vec::new();
    for uid in uids {
        series.extend(uploaded_series(context, &uid).await?);
    }
    Ok(Tally::of(outcomes, skipped).answer(series))
}

/// The number of instances that a request announces, if it can be one.
///
/// # Errors
/// [`Error::InvalidParameter`].
pub(super) fn checked(expect: Option<u64>, limits: &config::Intake) -> Result<Option<u64>> {
    let invalid = |detail| Error::InvalidParameter { name: "expect".to_owned(), detail };
    expect.map(|expect| check_expected(expect, limits).map(|()| expect).map_err(invalid)).transpose()
}

/// Notes the announced number for each series of the request.
///
/// # Errors
/// The catalog's.
pub(super) async fn note_expected(
    context: &Context,
    outcomes: &[Outcome],
    expect: Option<u64>,
) -> Result<()> {
    let Some(expect) = expect else { return Ok(()) };
    for series in series_of(outcomes) {
        context.intake.expect(&series, expect).await?;
    }
    Ok(())
}

/// One instance of one frame is no series: the rest comes in requests of its own, and the short
/// quiet time tells its end.
fn is_lone_slice(outcomes: &[Outcome]) -> bool {
    matches!(outcomes, [Outcome { result: Ok(receipt), .. }] if receipt.header.frames == 1)
}

/// Whether an empty file was meant to be an instance: it is named like one that is. Media hold other empty
/// files too.
fn is_lost_instance(file: &Skipped, outcomes: &[Outcome]) -> bool {
    let lost = FileName::of(&file.name);
    file.reason == SkipReason::Empty
        && !lost.shape.starts_with('.')
        && outcomes
            .iter()
            .filter(|outcome| outcome.result.is_ok())
            .any(|outcome| FileName::of(&outcome.name).is_like(&lost))
}

/// What the name of a file tells of its kind.
struct FileName {
    /// The name without its folders, each run of digits as one sign.
    shape: String,
    /// Its extension, unless that is a number, as in UIDs.
    extension: Option<String>,
}

impl FileName {
    fn of(path: &str) -> Self {
        let mut shape = String::new();
        for letter in path.rsplit(['/', '\\']).next().unwrap_or(path).to_lowercase().chars() {
            let letter = if letter.is_ascii_digit() { '#' } else { letter };
            if letter != '#' || !shape.ends_with('#') {
                shape.push(letter);
            }
        }
        let extension = shape.rsplit_once('.').map(|(_, extension)| extension.to_owned());
        let extension = extension.filter(|extension| extension != "#");
        Self { shape, extension }
    }

    fn is_like(&self, other: &Self) -> bool {
        self.shape == other.shape || (self.extension.is_some() && self.extension == other.extension)
    }
}

fn series_of(outcomes: &[Outcome]) -> std::collections::BTreeSet<SeriesInstanceUid> {
    outcomes
        .iter()
        .filter_map(|outcome| outcome.result.as_ref().ok())
        .map(|receipt| receipt.header.series_instance_uid.clone())
        .collect()
}

async fn uploaded_series(context: &Context, uid: &SeriesInstanceUid) -> Result<Option<UploadedSeries>> {
    let Some(series) = context.store.series(uid).await? else { return Ok(None) };
    let filter = ReconstructionFilter { series_instance_uid: Some(uid.clone()), state: None };
    let latest = context.store.list_reconstructions(&filter, None, 1).await?.rows.pop();
    Ok(Some(UploadedSeries {
        series: SeriesView::from(series),
        reconstruction: latest.map(ReconstructionView::from),
    }))
}
