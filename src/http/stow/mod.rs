//! STOW-RS (PS3.18 section 10.5): instances as `multipart/related; type="application/dicom"`, or
//! one instance as `application/dicom`.

mod response;

use std::sync::Arc;

use axum::Extension;
use axum::body::Body;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use bytes::{Bytes, BytesMut};
use serde::Deserialize;

use super::Context;
use super::client::Client;
use super::extract::{Parameters, StudyPath};
use super::identity::Identity;
use super::media_type::{MediaType, negotiate};
use super::multipart::Multipart;
use super::upload::{Arriving, Budget, Finished, Session, Source, admit, checked, note_expected};
use crate::dicom::uid::StudyInstanceUid;
use crate::error::{Error, Result};

const DICOM: &str = "application/dicom";
const DICOM_JSON: &str = "application/dicom+json";

/// So many bytes hold the file meta information.
const HEAD: usize = 2048;

/// What the query of a Store transaction says (PS3.18 section 8.3 lets a service define its own).
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct StoreQuery {
    /// Instances that each series of the request has in all, those that other requests send among them; at
    /// most `intake.max_series_instances`. With it, a series is complete when it has so many; without it, when
    /// nothing more came for the short quiet time.
    #[param(minimum = 1, example = 145)]
    expect: Option<u64>,
}

/// Store instances (STOW-RS)
///
/// 200: all are stored and durable; 202: some were refused; 409: all were. The answer lists each
/// instance, and for a refused one the failure reason (the status that C-STORE gives). A query parameter that
/// is not known is ignored, as PS3.18 wants it, and the header Warning says so.
#[utoipa::path(
    post,
    path = "/dicom-web/studies",
    operation_id = "storeInstances",
    tag = "DICOMweb",
    params(StoreQuery),
    request_body(description = "Part 10 files.", content(
        (Vec<u8> = "multipart/related; type=\"application/dicom\""),
        (Vec<u8> = "application/dicom"),
    )),
    responses(
        (status = 200, description = "All are stored.", body = serde_json::Value, content_type = "application/dicom+json"),
        (status = 202, description = "Some are stored, some refused.", body = serde_json::Value, content_type = "application/dicom+json"),
        (status = 400, description = "The body can't be read."),
        (status = 406, description = "The answer is application/dicom+json; that is not accepted."),
        (status = 408, description = "The body stopped coming."),
        (status = 409, description = "All were refused.", body = serde_json::Value, content_type = "application/dicom+json"),
        (status = 413, description = "Larger than http.max_upload_bytes, or more parts than http.max_archive_entries."),
        (status = 415, description = "Neither multipart/related of application/dicom nor application/dicom."),
        (status = 422, description = "No instance in it."),
        (status = 507, description = "The disk is nearly full."),
    ),
)]
pub(super) async fn store_instances(
    State(context): State<Context>,
    Parameters(query): Parameters<StoreQuery>,
    Extension(client): Extension<Client>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response> {
    store(&context, &client, None, &query, &headers, body).await
}

/// Store instances of one study (STOW-RS)
///
/// As `POST /dicom-web/studies`; an instance of another study is refused (failure reason A900).
#[utoipa::path(
    post,
    path = "/dicom-web/studies/{study}",
    operation_id = "storeInstancesOfStudy",
    tag = "DICOMweb",
    params(("study" = StudyInstanceUid, Path, description = "Study Instance UID."), StoreQuery),
    request_body(description = "Part 10 files.", content(
        (Vec<u8> = "multipart/related; type=\"application/dicom\""),
        (Vec<u8> = "application/dicom"),
    )),
    responses(
        (status = 200, description = "All are stored.", body = serde_json::Value, content_type = "application/dicom+json"),
        (status = 202, description = "Some are stored, some refused.", body = serde_json::Value, content_type = "application/dicom+json"),
        (status = 400, description = "The body or the study's UID can't be read."),
        (status = 406, description = "The answer is application/dicom+json; that is not accepted."),
        (status = 408, description = "The body stopped coming."),
        (status = 409, description = "All were refused.", body = serde_json::Value, content_type = "application/dicom+json"),
        (status = 413, description = "Larger than http.max_upload_bytes, or more parts than http.max_archive_entries."),
        (status = 415, description = "Neither multipart/related of application/dicom nor application/dicom."),
        (status = 422, description = "No instance in it."),
        (status = 507, description = "The disk is nearly full."),
    ),
)]
pub(super) async fn store_instances_of_study(
    State(context): State<Context>,
    StudyPath(study): StudyPath,
    Parameters(query): Parameters<StoreQuery>,
    Extension(client): Extension<Client>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response> {
    store(&context, &client, Some(study), &query, &headers, body).await
}

/// What is stored of one request.
struct Storing {
    session: Session,
    budget: Budget,
    /// What each instance calls itself, by its place in the request.
    identities: Vec<Identity>,
}

async fn store(
    context: &Context,
    client: &Client,
    study: Option<StudyInstanceUid>,
    query: &StoreQuery,
    headers: &HeaderMap,
    body: Body,
) -> Result<Response> {
    let expect = checked(query.expect, &context.config.intake)?;
    // Some clients name the media type of a multipart answer's parts; JSON is what there is.
    if negotiate(headers, &[DICOM_JSON, "application/json"]).is_none() {
        return Err(Error::NotAcceptable(DICOM_JSON));
    }
    let media_type = MediaType::of_request(headers).unwrap_or_else(MediaType::unknown);
    let (mut incoming, place) = admit(context, client, headers, body)?;
    let session = Session::new(context.intake.clone(), Arc::clone(place.upload()), study);
    let mut storing = Storing { session, budget: Budget::new(&context.config.http), identities: Vec::new() };
    match media_type.essence() {
        "multipart/related"
            if media_type.parameter("type").is_none_or(|it| it.eq_ignore_ascii_case(DICOM)) =>
        {
            let mut multipart = Multipart::new(incoming, &media_type)?;
            if let Err(error) = storing.parts(&mut multipart).await {
                multipart.linger().await;
                return Err(error);
            }
        }
        DICOM => {
            if let Err(error) = storing.instance(Source::Body(&mut incoming)).await {
                incoming.linger().await;
                return Err(error);
            }
        }
        _ => {
            incoming.linger().await;
            return Err(Error::UnsupportedMediaType(
                "send multipart/related; type=\"application/dicom\", or application/dicom".to_owned(),
            ));
        }
    }
    let Finished { id, outcomes, end } = storing.session.finish().await?;
    note_expected(context, &outcomes, expect).await?;
    // A PACS may store a series in many requests: the quiet time tells the last one.
    context.intake.sender_ended(id, end).await?;
    if outcomes.is_empty() {
        return Err(Error::EmptyUpload);
    }
    Ok(response::respond(&outcomes, &storing.identities))
}

impl Storing {
    async fn parts(&mut self, multipart: &mut Multipart) -> Result<()> {
        while let Some(headers) = multipart.next_part().await? {
            let named = headers.media_type.as_ref().map(MediaType::essence);
            if named.is_some_and(|essence| essence != DICOM) {
                let arriving = self.begin(&Bytes::new()).await?;
                let error = Error::UnsupportedMediaType("every part must be application/dicom".to_owned());
                self.session.abandon(arriving, error);
                continue;
            }
            self.instance(Source::Part(multipart)).await?;
        }
        Ok(())
    }

    async fn instance(&mut self, mut source: Source<'_>) -> Result<()> {
        let mut head = BytesMut::new();
        while head.len() < HEAD {
            match source.chunk().await? {
                Some(chunk) => {
                    self.session.expect_instance();
                    head.extend_from_slice(&chunk);
                }
                None => break,
            }
        }
        if head.is_empty() && matches!(source, Source::Body(_)) {
            return Ok(());
        }
        let head = head.freeze();
        let mut arriving = self.begin(&head).await?;
        arriving.write(&head).await?;
        while let Some(chunk) = source.chunk().await? {
            arriving.write(&chunk).await?;
        }
        self.session.end(arriving).await
    }

    async fn begin(&mut self, head: &[u8]) -> Result<Arriving> {
        self.budget.entry()?;
        self.identities.push(Identity::of(head));
        self.session.begin(String::new(), head).await
    }
}
