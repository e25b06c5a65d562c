//! The API by resource.

pub(super) mod clinical;
pub(super) mod cloud;
mod doubts;
pub(super) mod events;
pub(super) mod health;
pub(super) mod pages;
pub(super) mod reconstructions;
pub(super) mod report;
pub(super) mod series;
pub(super) mod series_control;
pub(super) mod slices;

pub(super) use series_control::check_expected;

use serde::Deserialize;

use super::Context;
use super::about::Newer;
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::{Error, Result};
use crate::store::{ReconstructionId, ReconstructionRecord, SeriesRecord};

/// A cursor, as long as any of ours can be.
const MAX_CURSOR: usize = 200;

async fn series_record(context: &Context, uid: &SeriesInstanceUid) -> Result<SeriesRecord> {
    let record = context.store.series(uid).await?;
    record.ok_or_else(|| Error::NotFound { what: "series", id: uid.to_string() })
}

/// Refuses what shows a patient while it is not known which: the series' identity is changing.
async fn steady(context: &Context, uid: &SeriesInstanceUid) -> Result<()> {
    if context.store.series(uid).await?.is_some_and(|series| series.identity_changing) {
        return Err(Error::IdentityChanging(uid.clone()));
    }
    Ok(())
}

async fn reconstruction_record(context: &Context, id: ReconstructionId) -> Result<ReconstructionRecord> {
    let record = context.store.reconstruction(id).await?;
    record.ok_or_else(|| Error::NotFound { what: "reconstruction", id: id.to_string() })
}

/// Which revision a request for a series' result puts up with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
pub(super) enum WantedRevision {
    /// The latest one alone.
    Current,
}

/// The clinical reconstruction of a series.
async fn clinical(
    context: &Context,
    uid: &SeriesInstanceUid,
    wanted: Option<WantedRevision>,
) -> Result<ReconstructionRecord> {
    steady(context, uid).await?;
    let clinical = context.store.clinical(uid).await?;
    if let Some(WantedRevision::Current) = wanted {
        let series = series_record(context, uid).await?;
        let served = clinical.as_ref().map(|clinical| &clinical.reconstruction);
        if let Some(newer) = Newer::than(context, &series, served).await? {
            return Err(not_current(&newer));
        }
        if let Some(record) = served.filter(|record| record.is_of_former_decoder()) {
            return Err(made_again(context, &series, record).await?);
        }
    }
    match clinical {
        Some(clinical) => Ok(clinical.reconstruction),
        None => Err(without_clinical(context, uid).await?),
    }
}

/// When to ask again for what is being made, s.
const AT_WORK_S: u32 = 5;
/// When to ask again for what somebody must act for, s.
const ENDED_S: u32 = 60;

/// What a client can do about a cloud that was made with a decoder at fault, `served` of the latest revision.
async fn made_again(
    context: &Context,
    series: &SeriesRecord,
    served: &ReconstructionRecord,
) -> Result<Error> {
    let again = context.store.clinical_at(&series.series_instance_uid, series.revision).await?;
    let state = again.filter(|again| again.id != served.id).map_or(served.state, |again| again.state);
    let (detail, retry_after_s) = if state.is_final() {
        (
            "but release 0.1 made what is served of it, with a decoder that could read JPEG Lossless wrongly: start \
             its reconstruction again, or choose another one as clinical; without revision=current it is served, \
             with the doubt former_decoder",
            ENDED_S,
        )
    } else {
        (
            "it is made again, as the decoder of release 0.1 could read JPEG Lossless wrongly; ask again",
            AT_WORK_S,
        )
    };
    Ok(Error::NotCurrent { revision: series.revision, state: state.name(), detail, retry_after_s })
}

/// What a client can do about a latest revision that has no cloud.
fn not_current(newer: &Newer) -> Error {
    let (detail, retry_after_s) = match newer.state {
        "receiving" => ("instances are still coming; ask again", AT_WORK_S),
        "queued" | "running" => ("its cloud is being made; ask again", AT_WORK_S),
        "not_reconstructable" => {
            ("see unfit_reason of the series; without revision=current an earlier one is served", ENDED_S)
        }
        _ => (
            "see its reconstruction's error, or start it again; without revision=current an earlier one is served",
            ENDED_S,
        ),
    };
    Error::NotCurrent { revision: newer.revision, state: newer.state, detail, retry_after_s }
}

/// Why a series has nothing to serve.
async fn without_clinical(context: &Context, uid: &SeriesInstanceUid) -> Result<Error> {
    let series = series_record(context, uid).await?;
    let latest = context.store.clinical_at(uid, series.revision).await?;
    if let Some(ended) = latest.filter(|record| record.state.is_final()) {
        let report = if ended.has_report { "/report" } else { "" };
        let code = ended.error_code.as_deref().unwrap_or("no error");
        return Ok(Error::ReconstructionState {
            state: ended.state.name(),
            detail: format!("it gave no cloud ({code}); /v1/reconstructions/{}{report} tells more", ended.id),
        });
    }
    Ok(match series.unfit_reason {
        Some(reason) => {
            let detail = unfit_detail(context, uid).await?;
            Error::NotReconstructable { uid: uid.clone(), reason: reason.name().to_owned(), detail }
        }
        None => Error::SeriesIncomplete(series.series_instance_uid),
    })
}

/// Why a series is no head CT, with figures and limit.
async fn unfit_detail(context: &Context, uid: &SeriesInstanceUid) -> Result<Option<String>> {
    context.store.unfit_detail(uid, context.config.intake.min_slices).await
}

/// The rows of one page: at most `http.max_page`, all of them unless the request wants fewer.
fn page_limit(context: &Context, asked: Option<u32>) -> Result<u32> {
    let most = context.config.http.max_page;
    match asked {
        None => Ok(most),
        Some(limit) if (1..=most).contains(&limit) => Ok(limit),
        Some(_) => Err(Error::InvalidParameter {
            name: "limit".to_owned(),
            detail: format!("1 to {most} (http.max_page)"),
        }),
    }
}

fn checked_cursor(cursor: Option<&str>) -> Result<Option<&str>> {
    match cursor {
        Some(cursor) if cursor.len() > MAX_CURSOR => Err(Error::InvalidParameter {
            name: "cursor".to_owned(),
            detail: "use next_cursor of the page before as it is".to_owned(),
        }),
        cursor => Ok(cursor),
    }
}

/// Notes a stored result that is damaged in log and metrics.
fn readable<T>(context: &Context, read: Result<T>) -> Result<T> {
    if let Err(Error::ResultDamaged { id, damage }) = &read {
        context.metrics.result_damaged();
        tracing::error!(reconstruction = %id, damage, "a stored result is damaged");
    }
    read
}

/// Runs work that needs the processor, or reads files, off tokio's threads.
async fn off_the_runtime<T: Send + 'static>(work: impl FnOnce() -> Result<T> + Send + 'static) -> Result<T> {
    match tokio::task::spawn_blocking(work).await {
        Ok(result) => result,
        Err(panic) => Err(Error::internal(panic)),
    }
}
