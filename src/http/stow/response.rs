//! The Store Instances Response (PS3.18 section 10.5.3, PS3.18 annex I) in the DICOM JSON model
//! (PS3.18 annex F).

use axum::Json;
use axum::http::StatusCode;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};
use serde_json::{Map, Value, json};

use super::DICOM_JSON;
use crate::dicom::uid::{SopClassUid, SopInstanceUid};
use crate::http::identity::Identity;
use crate::http::upload::Outcome;

const REFERENCED_SOP_CLASS_UID: &str = "00081150";
const REFERENCED_SOP_INSTANCE_UID: &str = "00081155";
const RETRIEVE_URL: &str = "00081190";
const FAILURE_REASON: &str = "00081197";
const FAILED_SOP_SEQUENCE: &str = "00081198";
const REFERENCED_SOP_SEQUENCE: &str = "00081199";
const OTHER_FAILURES_SEQUENCE: &str = "0008119A";

/// 200 if all are stored, 409 if none is, 202 otherwise.
pub(super) fn respond(outcomes: &[Outcome], identities: &[Identity]) -> Response {
    let (mut stored, mut failed, mut other) = (Vec::new(), Vec::new(), Vec::new());
    for outcome in outcomes {
        let identity = identities.get(outcome.index).cloned().unwrap_or_default();
        match &outcome.result {
            Ok(receipt) => {
                let mut item = reference(&receipt.header.sop_class_uid, &receipt.header.sop_instance_uid);
                // Type 2, and empty: instances are not served back.
                item.insert(RETRIEVE_URL.to_owned(), json!({ "vr": "UR" }));
                stored.push(Value::Object(item));
            }
            Err(error) => {
                let reason = json!({ "vr": "US", "Value": [error.mapping().dimse_status] });
                match (identity.sop_class_uid, identity.sop_instance_uid) {
                    (Some(class), Some(instance)) => {
                        let mut item = reference(&class, &instance);
                        item.insert(FAILURE_REASON.to_owned(), reason);
                        failed.push(Value::Object(item));
                    }
                    // Nothing tells which instance it is.
                    _ => other.push(json!({ FAILURE_REASON: reason })),
                }
            }
        }
    }
    let status = match (stored.is_empty(), failed.is_empty() && other.is_empty()) {
        (_, true) => StatusCode::OK,
        (true, false) => StatusCode::CONFLICT,
        (false, false) => StatusCode::ACCEPTED,
    };
    let mut data_set = Map::new();
    data_set.insert(RETRIEVE_URL.to_owned(), json!({ "vr": "UR" }));
    for (tag, items) in
        [(FAILED_SOP_SEQUENCE, failed), (REFERENCED_SOP_SEQUENCE, stored), (OTHER_FAILURES_SEQUENCE, other)]
    {
        if !items.is_empty() {
            data_set.insert(tag.to_owned(), json!({ "vr": "SQ", "Value": items }));
        }
    }
    (status, [(CONTENT_TYPE, DICOM_JSON)], Json(Value::Object(data_set))).into_response()
}

fn reference(class: &SopClassUid, instance: &SopInstanceUid) -> Map<String, Value> {
    let mut item = Map::new();
    item.insert(REFERENCED_SOP_CLASS_UID.to_owned(), json!({ "vr": "UI", "Value": [class] }));
    item.insert(REFERENCED_SOP_INSTANCE_UID.to_owned(), json!({ "vr": "UI", "Value": [instance] }));
    item
}
