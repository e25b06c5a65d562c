//! What every cloud, report and picture says of itself in its headers: which reconstruction it is of,
//! how far that can be trusted, and whether a newer revision of the series is there or on its way.

use axum::http::header::{CONTENT_LOCATION, LINK};
use axum::http::{HeaderMap, HeaderName, HeaderValue};
use axum::response::Response;

use super::Context;
use crate::error::{Error, Result};
use crate::pipeline::name_of;
use crate::store::{ReconstructionId, ReconstructionRecord, SeriesRecord, SeriesState};

/// The reconstruction's id.
const RECONSTRUCTION: HeaderName = HeaderName::from_static("triplanar-reconstruction");
/// The revision of the series that it was made from.
const REVISION: HeaderName = HeaderName::from_static("triplanar-revision");
/// The algorithm and its version.
const ALGORITHM: HeaderName = HeaderName::from_static("triplanar-algorithm");
/// The verdict.
const VERDICT: HeaderName = HeaderName::from_static("triplanar-verdict");
/// The doubts.
const DOUBTS: HeaderName = HeaderName::from_static("triplanar-doubts");
/// A revision of the series that is newer.
const NEWER_REVISION: HeaderName = HeaderName::from_static("triplanar-newer-revision");

/// The headers as the API's description lists them: name, meaning.
pub(super) const DESCRIBED: [(&str, &str); 8] = [
    ("Content-Location", "Path of what was sent: by the reconstruction's id, it never changes."),
    ("Triplanar-Reconstruction", "Id of the reconstruction that it is of."),
    ("Triplanar-Revision", "Revision of the series that the reconstruction was made from."),
    ("Triplanar-Algorithm", "The algorithm that made it and its version, e.g. `precise/1`."),
    (
        "Triplanar-Verdict",
        "`good`, `limited` or `insufficient`; `none` where there is none (profile `paper`, no cloud).",
    ),
    (
        "Triplanar-Doubts",
        "The reasons of the verdict, the doubts of the transfer of its revision (`incomplete_transfer`, \
         `instances_refused`) and `former_decoder` (release 0.1 made it with a decoder that could read JPEG \
         Lossless wrongly), joined by commas; `none` if there are none.",
    ),
    (
        "Triplanar-Newer-Revision",
        "Only where the series has a newer revision than this one, or will have: its number, \
         `; state=` and its state (`receiving`, `queued`, `running`, `failed`, `cancelled`, `succeeded`, \
         `superseded`, `not_reconstructable`, `removed`) and, where it has one, `; reconstruction=` and the id \
         of its clinical reconstruction.",
    ),
    ("Link", "With `rel=\"latest-version\"`: where the newer revision is to be found."),
];

/// A revision of a series that is newer than a reconstruction's.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Newer {
    /// Its number.
    pub(super) revision: u32,
    /// How far it is.
    pub(super) state: &'static str,
    /// Its clinical reconstruction, where it has one.
    pub(super) reconstruction: Option<ReconstructionId>,
}

impl Newer {
    /// What is newer of that series than `record`, one of its reconstructions; `None` has nothing newer
    /// only before the first revision.
    pub(super) async fn than(
        context: &Context,
        series: &SeriesRecord,
        record: Option<&ReconstructionRecord>,
    ) -> Result<Option<Self>> {
        if series.state == SeriesState::Receiving {
            let next = series.revision + 1;
            return Ok(Some(Self { revision: next, state: series.state.name(), reconstruction: None }));
        }
        if record.map_or(series.revision == 0, |record| record.is_of_latest(series)) {
            return Ok(None);
        }
        let latest = context.store.clinical_at(&series.series_instance_uid, series.revision).await?;
        let state = match (&latest, series.state) {
            (_, SeriesState::NotReconstructable) => series.state.name(),
            (Some(record), _) => record.state.name(),
            (None, _) => "removed",
        };
        let reconstruction = latest.map(|record| record.id);
        Ok(Some(Self { revision: series.revision, state, reconstruction }))
    }
}

/// The headers of one answer.
pub(super) struct About(HeaderMap);

impl About {
    /// Of a part of that reconstruction, which is always found at `location`.
    pub(super) async fn of(context: &Context, record: &ReconstructionRecord, location: &str) -> Result<Self> {
        let uid = &record.series_instance_uid;
        let series = context.store.series(uid).await?;
        let series = series.ok_or_else(|| Error::NotFound { what: "series", id: uid.to_string() })?;
        let mut headers = HeaderMap::new();
        let mut set = |name: HeaderName, value: &str| -> Result<()> {
            headers.insert(name, HeaderValue::from_str(value).map_err(Error::internal)?);
            Ok(())
        };
        set(CONTENT_LOCATION, location)?;
        set(RECONSTRUCTION, &record.id.to_string())?;
        set(REVISION, &record.revision.to_string())?;
        set(ALGORITHM, &record.algorithm)?;
        let quality = record.quality.as_ref();
        set(VERDICT, &quality.map_or_else(|| "none".to_owned(), |quality| name_of(&quality.verdict)))?;
        set(DOUBTS, &doubts(record))?;
        if let Some(newer) = Newer::than(context, &series, Some(record)).await? {
            let Newer { revision, state, reconstruction } = newer;
            let id = reconstruction.map_or_else(String::new, |id| format!("; reconstruction={id}"));
            set(NEWER_REVISION, &format!("{revision}; state={state}{id}"))?;
            let path = reconstruction
                .map_or_else(|| format!("/v1/series/{uid}"), |id| format!("/v1/reconstructions/{id}"));
            set(LINK, &format!("<{path}>; rel=\"latest-version\""))?;
        }
        Ok(Self(headers))
    }

    /// The answer with these headers.
    pub(super) fn on(self, mut response: Response) -> Response {
        response.headers_mut().extend(self.0);
        response
    }
}

/// Those of the result, and those of the transfer of its revision and of its decoder.
fn doubts(record: &ReconstructionRecord) -> String {
    let of_result = record.quality.iter().flat_map(|quality| quality.doubts.iter().map(name_of));
    let of_transfer = record.transfer_doubts.iter().map(|doubt| doubt.name().to_owned());
    let all: Vec<String> = of_result.chain(of_transfer).collect();
    if all.is_empty() { "none".to_owned() } else { all.join(", ") }
}
