//! What a handler needs from a request, with our problems as refusals.

use std::str::FromStr;

use axum::extract::{FromRequest, FromRequestParts, Path, Query, Request};
use axum::http::header::CONTENT_TYPE;
use axum::http::request::Parts;
use serde::de::DeserializeOwned;

use super::Context;
use super::body::Incoming;
use super::json::Unique;
use crate::dicom::uid::{SeriesInstanceUid, StudyInstanceUid};
use crate::error::{Error, Result};
use crate::store::ReconstructionId;

/// The path's parameters as texts.
async fn path<T: DeserializeOwned + Send>(parts: &mut Parts, state: &Context) -> Result<T> {
    let path = Path::<T>::from_request_parts(parts, state).await.map_err(|rejection| {
        Error::InvalidParameter { name: "path".to_owned(), detail: rejection.body_text() }
    })?;
    Ok(path.0)
}

/// Reads the text of a parameter.
///
/// # Errors
/// [`Error::InvalidParameter`].
pub(super) fn parse<T: FromStr>(name: &str, text: &str) -> Result<T>
where
    T::Err: std::fmt::Display,
{
    text.parse()
        .map_err(|wrong: T::Err| Error::InvalidParameter { name: name.to_owned(), detail: wrong.to_string() })
}

/// The only parameter of the path: a Series Instance UID.
pub(super) struct SeriesPath(pub(super) SeriesInstanceUid);

impl FromRequestParts<Context> for SeriesPath {
    type Rejection = Error;
    async fn from_request_parts(parts: &mut Parts, state: &Context) -> Result<Self> {
        parse("series", &path::<String>(parts, state).await?).map(Self)
    }
}

/// The only parameter of the path: a Study Instance UID.
pub(super) struct StudyPath(pub(super) StudyInstanceUid);

impl FromRequestParts<Context> for StudyPath {
    type Rejection = Error;
    async fn from_request_parts(parts: &mut Parts, state: &Context) -> Result<Self> {
        parse("study", &path::<String>(parts, state).await?).map(Self)
    }
}

/// The only parameter of the path: a reconstruction's id.
pub(super) struct ReconstructionPath(pub(super) ReconstructionId);

impl FromRequestParts<Context> for ReconstructionPath {
    type Rejection = Error;
    async fn from_request_parts(parts: &mut Parts, state: &Context) -> Result<Self> {
        reconstruction_id(&path::<String>(parts, state).await?).map(Self)
    }
}

fn reconstruction_id(text: &str) -> Result<ReconstructionId> {
    parse("id", text)
}

/// Where a slice's picture is: reconstruction, plane, `{index}.png`.
pub(super) struct SlicePath {
    pub(super) id: ReconstructionId,
    pub(super) plane: String,
    pub(super) picture: String,
}

impl FromRequestParts<Context> for SlicePath {
    type Rejection = Error;
    async fn from_request_parts(parts: &mut Parts, state: &Context) -> Result<Self> {
        let (id, plane, picture) = path::<(String, String, String)>(parts, state).await?;
        Ok(Self { id: reconstruction_id(&id)?, plane, picture })
    }
}

/// The query's parameters; those that the operation does not know are refused before ([`super::query`]).
pub(super) struct Parameters<T>(pub(super) T);

impl<T: DeserializeOwned + Send> FromRequestParts<Context> for Parameters<T> {
    type Rejection = Error;
    async fn from_request_parts(parts: &mut Parts, state: &Context) -> Result<Self> {
        let query = Query::<T>::from_request_parts(parts, state).await.map_err(|rejection| {
            Error::InvalidParameter { name: "query".to_owned(), detail: rejection.body_text() }
        })?;
        Ok(Self(query.0))
    }
}

/// A JSON body; `None` where there is none.
pub(super) struct JsonBody(pub(super) Option<serde_json::Value>);

impl FromRequest<Context> for JsonBody {
    type Rejection = Error;
    async fn from_request(request: Request, state: &Context) -> Result<Self> {
        let is_json = request.headers().get(CONTENT_TYPE).map(|value| {
            let essence = value.to_str().unwrap_or("").split(';').next().unwrap_or("").trim();
            essence.eq_ignore_ascii_case("application/json")
        });
        let bytes = Incoming::json(request.into_body(), &state.config.http).whole().await?;
        match is_json {
            _ if bytes.is_empty() => Ok(Self(None)),
            Some(true) => serde_json::from_slice(&bytes)
                .map(|Unique(value)| Self(Some(value)))
                .map_err(|wrong| Error::InvalidBody(wrong.to_string())),
            Some(false) | None => {
                Err(Error::UnsupportedMediaType("the body must be application/json".to_owned()))
            }
        }
    }
}

impl JsonBody {
    /// The body as a `T`.
    ///
    /// # Errors
    /// [`Error::InvalidBody`] if there is none, it is no object, or no `T`.
    pub(super) fn of<T: DeserializeOwned>(self) -> Result<T> {
        let value = self.0.filter(serde_json::Value::is_object);
        let value = value.ok_or_else(|| Error::InvalidBody("a JSON object is needed".to_owned()))?;
        serde_json::from_value(value).map_err(|wrong| Error::InvalidBody(wrong.to_string()))
    }
}
