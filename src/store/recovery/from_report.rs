//! The record of a result of version 0.1, which wrote none, as far as its report tells.

use std::collections::HashSet;

use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};

use super::ResultRecord;
use crate::dicom::uid::{SeriesInstanceUid, SopInstanceUid};
use crate::error::Result;
use crate::pipeline::Parameters;
use crate::store::catalog::{Catalog, Columns, bytes};
use crate::store::reading::cloud_name;
use crate::store::records::{ReconstructionId, ReconstructionState, SeriesState};
use crate::store::stored::parameter_json;

/// `None` if the report is none, does not say whose it is, or is of a release that wrote a record beside it:
/// only 0.1 numbered no schema.
pub(super) async fn record(
    catalog: &Catalog,
    prefix: &str,
    report: &[u8],
    keys: &[String],
    written_ms: i64,
) -> Result<Option<ResultRecord>> {
    let Some(told) = Told::read(prefix, report) else { return Ok(None) };
    let parameters = parameter_json::write(&told.parameters);
    // The catalog brings it to this version's identity when it is opened next.
    let hash: [u8; 32] = Sha256::digest(&parameters).into();
    let stored = catalog.instances(&told.series).await?;
    let uids: HashSet<&SopInstanceUid> = stored.iter().map(|row| &row.header.sop_instance_uid).collect();
    let from_these = !told.instances.is_empty() && told.instances.iter().all(|uid| uids.contains(uid));
    let (set, count) = catalog.stored_set(&told.series).await?;
    let is_first = !catalog.has_reconstruction(&told.series, &set, &hash).await?;
    // Which instances an earlier revision had is not known any more: a set that no series has.
    let (revision, set, made_from) = if from_these && is_first {
        (1, set, stored.iter().map(|row| row.header.sop_instance_uid.to_string()).collect())
    } else {
        (0, Sha256::digest(told.id.to_string()).into(), Vec::new())
    };
    let has_cloud = keys.iter().any(|key| *key == format!("{prefix}/{}", cloud_name(None)));
    let state = if has_cloud { ReconstructionState::Succeeded } else { ReconstructionState::Failed };
    let reconstruction = json!({
        "id": told.id.to_string(),
        "series_uid": told.series.as_str(),
        "revision": revision,
        "instances_sha256": bytes(&set),
        "instances": if made_from.is_empty() { told.instances.len() as u64 } else { count },
        "parameters": parameters,
        "parameters_sha256": bytes(&hash),
        "software": told.report["software"],
        "state": state.name(),
        "fraction": if has_cloud { 1.0 } else { 0.0 },
        "attempts": 1,
        "error_code": told.report["error"]["code"],
        "error_detail": told.report["error"]["detail"],
        "error_instances": "[]",
        "figures": has_cloud.then(|| told.report["figures"].to_string()),
        "quality": Some(&told.report["quality"]).filter(|q| has_cloud && !q.is_null()).map(Value::to_string),
        "has_report": true,
        "created_ms": told.created_ms.unwrap_or(written_ms),
        "started_ms": null,
        "finished_ms": written_ms,
        "not_before_ms": written_ms,
        "fence": 0,
        "cancel_requested": false,
    });
    let identity = &told.report["identity"];
    let series = json!({
        "series_uid": told.series.as_str(),
        "study_uid": identity["study_instance_uid"],
        "frame_of_reference_uid": identity["frame_of_reference_uid"],
        "modality": "CT",
        "state": SeriesState::Complete.name(),
        "revision": 0,
        "instances": 0,
        "bytes": 0,
        // 0.1 knew of no doubts: there is none if the result was made from all that is stored.
        "instances_sha256": (told.instances.len() as u64 == count).then(|| bytes(&set)),
        "incomplete_transfer": false,
        "created_ms": told.created_ms.unwrap_or(written_ms),
        "updated_ms": written_ms,
    });
    Ok(Some(ResultRecord::new(1, columns(reconstruction), columns(series), made_from)))
}

/// What a report says that a row needs.
struct Told {
    id: ReconstructionId,
    created_ms: Option<i64>,
    series: SeriesInstanceUid,
    parameters: Parameters,
    instances: HashSet<SopInstanceUid>,
    report: Value,
}

impl Told {
    fn read(prefix: &str, report: &[u8]) -> Option<Self> {
        let id: ReconstructionId = prefix.split('/').nth(1)?.parse().ok()?;
        let report: Value = serde_json::from_slice(report).ok()?;
        report.get("schema").is_none().then_some(())?;
        let slices = report["slices"].as_array()?;
        let instances =
            slices.iter().filter_map(|row| row["sop_instance_uid"].as_str()?.parse().ok()).collect();
        Some(Self {
            id,
            created_ms: id.0.get_timestamp().map(|time| {
                let (seconds, nanoseconds) = time.to_unix();
                i64::try_from(seconds).unwrap_or_default() * 1000 + i64::from(nanoseconds / 1_000_000)
            }),
            series: report["identity"]["series_instance_uid"].as_str()?.parse().ok()?,
            parameters: parameter_json::read(&report["parameters"].to_string()).ok()?,
            instances,
            report,
        })
    }
}

fn columns(value: Value) -> Columns {
    match value {
        Value::Object(columns) => columns,
        _ => Columns::new(),
    }
}
