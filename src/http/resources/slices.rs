//! Pictures of slices with their contours.

use std::io::Cursor;

use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method};
use axum::response::Response;
use bytes::Bytes;
use image::{ImageFormat, RgbImage};
use serde::Deserialize;

use super::{off_the_runtime, readable, reconstruction_record, steady};
use crate::error::{Error, Result};
use crate::geometry::Plane;
use crate::http::Context;
use crate::http::about::About;
use crate::http::extract::SlicePath;
use crate::http::representation::Representation;
use crate::pipeline::{Profile, border_picture, picture};
use crate::reconstruction::pictures::{self, Pictures};
use crate::render::caption;
use crate::store::{ReconstructionId, ReconstructionRecord};

/// How the picture was drawn.
const PICTURE: HeaderName = HeaderName::from_static("triplanar-picture");
/// From what was stored with the result.
const STORED: &str = "stored";
/// From the instances, by this version of the software.
const AGAIN: &str = "drawn-again";

/// Of a report, what a picture needs.
#[derive(Deserialize)]
struct Decisions {
    slices: Vec<Decision>,
}

#[derive(Deserialize)]
struct Decision {
    plane: Plane,
    index: usize,
    accepted: bool,
}

/// A slice with its contour
///
/// Drawn from what was stored with the result: it never changes. A result of 0.1 stored none of that;
/// its pictures are drawn from the instances by this version, and say so: `Triplanar-Picture:
/// drawn-again` (otherwise `stored`), and a line at the upper edge.
///
/// PNG: the slice in mm proportion (the smaller side of a voxel is a pixel), and drawn over it its
/// contour. Profile `paper`: green if the slice was accepted, red if not. Profile `precise`: the border
/// of the patient, accepted stretches green, rejected ones in a colour for each reason. `index` counts
/// as in the report: axial from the most superior, sagittal from the patient's right, coronal from the
/// most posterior.
#[utoipa::path(
    get,
    path = "/v1/reconstructions/{id}/slices/{plane}/{picture}",
    operation_id = "getSlicePicture",
    tag = "Results",
    params(
        ("id" = uuid::Uuid, Path, description = "The reconstruction's id."),
        ("plane" = inline(Plane), Path, description = "The plane."),
        ("picture" = String, Path, description = "`{index}.png`", pattern = r"^[0-9]{1,5}\.png$", example = "72.png"),
    ),
    responses(
        (status = 200, description = "The picture.", body = Vec<u8>, content_type = "image/png",
         headers(("ETag" = String, description = "Strong."))),
        (status = 206, description = "The part that Range asks for.", body = Vec<u8>, content_type = "image/png"),
        (status = 304, description = "The client has it: If-None-Match."),
        (status = 404, description = "No such reconstruction, plane or slice."),
        (status = 409, description = "The reconstruction has no report (yet), so its slices are not known."),
        (status = 410, description = "A result of 0.1 whose source instances are no longer stored."),
        (status = 416, description = "The range lies outside."),
        (status = 503, description = "The memory budget is in use: try again after Retry-After."),
    ),
)]
pub(in crate::http) async fn slice_picture(
    State(context): State<Context>,
    path: SlicePath,
    method: Method,
    headers: HeaderMap,
) -> Result<Response> {
    let no_slice = || Error::NotFound { what: "slice", id: format!("{}/{}", path.plane, path.picture) };
    let plane = Plane::ALL.into_iter().find(|plane| plane.name() == path.plane).ok_or_else(no_slice)?;
    let index = slice_index(&path.picture).ok_or_else(no_slice)?;
    let record = reconstruction_record(&context, path.id).await?;
    steady(&context, &record.series_instance_uid).await?;
    if !record.has_report {
        return Err(Error::ReconstructionState {
            state: record.state.name(),
            detail: "its slices are known when it has ended".to_owned(),
        });
    }
    let location = format!("/v1/reconstructions/{}/slices/{}/{}", record.id, path.plane, path.picture);
    let about = About::of(&context, &record, &location).await?;
    let (drawn, drawing) = if record.has_pictures {
        (STORED, stored(&context, &record, plane, index).await?)
    } else {
        (AGAIN, again(&context, &record, plane, index).await?)
    };
    let picture = drawing.ok_or_else(no_slice)?;
    let response = off_the_runtime(move || {
        let mut png = Cursor::new(Vec::new());
        picture.write_to(&mut png, ImageFormat::Png).map_err(Error::internal)?;
        let representation = Representation {
            bytes: Bytes::from(png.into_inner()),
            media_type: "image/png",
            file_name: None,
            compressible: false,
            vary: "Accept-Encoding",
        };
        representation.respond(&method, &headers)
    })
    .await?;
    let mut response = about.on(response);
    response.headers_mut().insert(PICTURE, HeaderValue::from_static(drawn));
    Ok(response)
}

/// The picture as the result was made; `None` if there is no such slice.
async fn stored(
    context: &Context,
    record: &ReconstructionRecord,
    plane: Plane,
    index: usize,
) -> Result<Option<RgbImage>> {
    let id = record.id;
    let share = context.memory.take(PICTURES_BYTES)?;
    let file = readable(context, context.store.pictures(id).await)?;
    off_the_runtime(move || {
        let _until_it_is_drawn = share;
        let drawn = Pictures::open(&file).and_then(|pictures| pictures.slice(plane, index));
        drawn.map_err(|why| Error::Unreadable {
            what: "the pictures of reconstruction",
            id: id.to_string(),
            detail: why.to_string(),
        })
    })
    .await
}

/// The picture of a result of 0.1, which stored none: drawn from the instances by this version, and
/// marked so.
async fn again(
    context: &Context,
    record: &ReconstructionRecord,
    plane: Plane,
    index: usize,
) -> Result<Option<RgbImage>> {
    let Some(accepted) = decision(context, record.id, plane, index).await? else { return Ok(None) };
    let volume = context.volumes.of(record).await?;
    let border = match record.parameters.profile {
        Profile::Paper => None,
        Profile::Precise => Some(context.volumes.border(&volume).await?),
    };
    let parameters = record.parameters.clone();
    off_the_runtime(move || {
        let picture = match border {
            None => picture(&volume, &parameters, plane, index, accepted),
            Some(border) => border_picture(&volume, &border, plane, index),
        };
        let mut picture =
            picture.ok_or_else(|| Error::internal("the report has a slice that the volume lacks"))?;
        caption(&mut picture, &format!("drawn again by {}", crate::SOFTWARE));
        Ok(Some(picture))
    })
    .await
}

/// What a stored picture takes while it is drawn: its file, and a slice.
const PICTURES_BYTES: u64 = pictures::MOST_BYTES as u64 + (4 << 20);

/// `72.png` → 72.
fn slice_index(picture: &str) -> Option<usize> {
    let digits = picture.strip_suffix(".png")?;
    let plain = (1..=5).contains(&digits.len()) && digits.bytes().all(|byte| byte.is_ascii_digit());
    plain.then(|| digits.parse().ok()).flatten()
}

/// Whether the slice was accepted; `None` if the volume has no such slice.
async fn decision(
    context: &Context,
    id: ReconstructionId,
    plane: Plane,
    index: usize,
) -> Result<Option<bool>> {
    let stored = context.store.report(id).await?;
    off_the_runtime(move || {
        let report: Decisions = serde_json::from_slice(&stored).map_err(Error::internal)?;
        let found = report.slices.iter().find(|slice| (slice.plane, slice.index) == (plane, index));
        Ok(found.map(|slice| slice.accepted))
    })
    .await
}

#[cfg(test)]
mod tests {
    use super::slice_index;

    #[test]
    fn a_slices_index_is_plain_digits() {
        assert_eq!(slice_index("72.png"), Some(72));
        for odd in ["72", "-1.png", "+1.png", ".png", "123456.png", "7 .png", "٣.png"] {
            assert_eq!(slice_index(odd), None, "{odd}");
        }
    }
}
