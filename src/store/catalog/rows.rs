//! Rows → records.

use std::fmt::Display;
use std::str::FromStr;

use sqlx::Row as _;
use sqlx::error::BoxDynError;

use super::dialect::Row;
use super::transfers::OpenSender;
use crate::dicom::header::InstanceHeader;
use crate::dicom::identity::Identity;
use crate::dicom::series::UnfitReason;
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::Error;
use crate::observer::Stage;
use crate::store::hashed::Seal;
use crate::store::records::{
    BrokenTransfer, ClinicalChoice, CompleteReason, InstanceRecord, ReconstructionRecord,
    ReconstructionState, Refused, SenderEnd, SeriesRecord, SeriesState, TransferDoubt, UnreadableRow,
};
use crate::store::stored::{Unreadable, figure_json, parameter_json, quality_json};

type Result<T, E = sqlx::Error> = std::result::Result<T, E>;
type Readable<T> = std::result::Result<T, Unreadable>;

fn decode_error(column: &str, source: impl Into<BoxDynError>) -> sqlx::Error {
    sqlx::Error::ColumnDecode { index: column.to_owned(), source: source.into() }
}

/// A text that `T` parses.
pub(super) fn parsed<T>(row: &Row, column: &str) -> Result<T>
where
    T: FromStr<Err: Display>,
{
    let text: &str = row.try_get(column)?;
    text.parse().map_err(|error: T::Err| decode_error(column, error.to_string()))
}

fn maybe_parsed<T>(row: &Row, column: &str) -> Result<Option<T>>
where
    T: FromStr<Err: Display>,
{
    let text: Option<&str> = row.try_get(column)?;
    text.map(str::parse).transpose().map_err(|error: T::Err| decode_error(column, error.to_string()))
}

/// A name of one of our enums.
fn named<T>(row: &Row, column: &str, from_name: impl Fn(&str) -> Option<T>) -> Result<T> {
    maybe_named(row, column, from_name)?.ok_or_else(|| decode_error(column, "null"))
}

fn maybe_named<T>(row: &Row, column: &str, from_name: impl Fn(&str) -> Option<T>) -> Result<Option<T>> {
    let text: Option<&str> = row.try_get(column)?;
    text.map(|text| from_name(text).ok_or_else(|| decode_error(column, format!("unknown name {text}"))))
        .transpose()
}

/// A number that fits into `T`.
pub(super) fn number<T: TryFrom<i64>>(row: &Row, column: &str) -> Result<T> {
    let value: i64 = row.try_get(column)?;
    T::try_from(value).map_err(|_| decode_error(column, "out of range"))
}

fn maybe_number<T: TryFrom<i64>>(row: &Row, column: &str) -> Result<Option<T>> {
    let value: Option<i64> = row.try_get(column)?;
    value.map(|value| T::try_from(value).map_err(|_| decode_error(column, "out of range"))).transpose()
}

/// A SHA-256.
pub(super) fn sha256(row: &Row, column: &str) -> Result<[u8; 32]> {
    let bytes: &[u8] = row.try_get(column)?;
    bytes.try_into().map_err(|_| decode_error(column, "not 32 bytes"))
}

/// Stored JSON, by the reader of its kind.
fn stored<T>(row: &Row, column: &str, read: impl Fn(&str) -> Readable<T>) -> Result<T> {
    read(row.try_get(column)?).map_err(|why| decode_error(column, why))
}

fn maybe_stored<T>(row: &Row, column: &str, read: impl Fn(&str) -> Readable<T>) -> Result<Option<T>> {
    let text: Option<&str> = row.try_get(column)?;
    text.map(read).transpose().map_err(|why| decode_error(column, why))
}

/// A list of UIDs as JSON.
fn uids<T: serde::de::DeserializeOwned>(row: &Row, column: &str) -> Result<Vec<T>> {
    serde_json::from_str(row.try_get(column)?).map_err(|error| decode_error(column, error))
}

/// What can't be decoded is told by its id; the database's own faults stay what they are.
fn readable<T>(decoded: Result<T>, what: &'static str, row: &Row, id: &str) -> Result<T, Error> {
    match decoded {
        Err(sqlx::Error::ColumnDecode { index, source }) => {
            let id: String = row.try_get(id)?;
            let detail = match source.downcast_ref::<Unreadable>() {
                Some(why) => why.to_string(),
                None => format!("column {index}: {source}"),
            };
            tracing::error!(what, id, detail, "a row can't be understood");
            Err(Error::Unreadable { what, id, detail })
        }
        other => Ok(other?),
    }
}

pub(super) fn series_state(row: &Row) -> Result<SeriesState> {
    named(row, "state", SeriesState::from_name)
}

pub(super) fn due_reason(row: &Row) -> Result<Option<CompleteReason>> {
    maybe_named(row, "due_reason", CompleteReason::from_name)
}

/// # Errors
/// [`Error::Unreadable`].
pub(super) fn series(row: &Row) -> Result<SeriesRecord, Error> {
    readable(series_record(row), "series", row, "series_uid")
}

fn series_record(row: &Row) -> Result<SeriesRecord> {
    Ok(SeriesRecord {
        series_instance_uid: parsed(row, "series_uid")?,
        study_instance_uid: parsed(row, "study_uid")?,
        frame_of_reference_uid: maybe_parsed(row, "frame_of_reference_uid")?,
        modality: row.try_get("modality")?,
        description: row.try_get("description")?,
        patient_id: row.try_get("patient_id")?,
        accession_number: row.try_get("accession_number")?,
        state: series_state(row)?,
        unfit_reason: maybe_named(row, "unfit_reason", UnfitReason::from_name)?,
        revision: number(row, "revision")?,
        complete_reason: maybe_named(row, "complete_reason", CompleteReason::from_name)?,
        sender_end: maybe_named(row, "sender_end", SenderEnd::from_name)?,
        doubts: [
            (TransferDoubt::IncompleteTransfer, flag(row, "incomplete_transfer")?),
            (TransferDoubt::InstancesRefused, number::<u32>(row, "held_refusals")? > 0),
            (TransferDoubt::FormerDecoder, is_of_former_decoder(row, "served_algorithm")?),
        ]
        .into_iter()
        .filter_map(|(doubt, held)| held.then_some(doubt))
        .collect(),
        instances_sha256: match row.try_get::<Option<&[u8]>, _>("instances_sha256")? {
            Some(_) => Some(sha256(row, "instances_sha256")?),
            None => None,
        },
        expected_instances: maybe_number(row, "expected_instances")?,
        instances: number(row, "instances")?,
        bytes: number(row, "bytes")?,
        refused_instances: number(row, "refused_instances")?,
        identity_changing: row.try_get::<Option<&str>, _>("identity_changing")?.is_some(),
        created_ms: row.try_get("created_ms")?,
        updated_ms: row.try_get("updated_ms")?,
    })
}

pub(super) fn instance(row: &Row) -> Result<InstanceRecord> {
    let image_type: &str = row.try_get("image_type")?;
    Ok(InstanceRecord {
        header: InstanceHeader {
            sop_class_uid: parsed(row, "sop_class_uid")?,
            sop_instance_uid: parsed(row, "sop_uid")?,
            study_instance_uid: parsed(row, "study_uid")?,
            series_instance_uid: parsed(row, "series_uid")?,
            transfer_syntax_uid: parsed(row, "transfer_syntax_uid")?,
            frame_of_reference_uid: maybe_parsed(row, "frame_of_reference_uid")?,
            modality: row.try_get("modality")?,
            image_type: if image_type.is_empty() {
                Vec::new()
            } else {
                image_type.split('\\').map(str::to_owned).collect()
            },
            series_description: row.try_get("description")?,
            identity: identity(row)?,
            frames: number(row, "frames")?,
            rows: maybe_number(row, "pixel_rows")?,
            columns: maybe_number(row, "pixel_columns")?,
            has_pixel_data: row.try_get("has_pixel_data")?,
            photometric: row.try_get("photometric")?,
            samples_per_pixel: maybe_number(row, "samples_per_pixel")?,
            has_position: row.try_get("has_position")?,
        },
        blob: row.try_get("blob")?,
        size: number(row, "size")?,
        data_set_sha256: sha256(row, "data_set_sha256")?,
        image_sha256: match row.try_get::<Option<&[u8]>, _>("image_sha256")? {
            Some(_) => sha256(row, "image_sha256")?,
            None => sha256(row, "data_set_sha256")?,
        },
        received_ms: row.try_get("received_ms")?,
    })
}

/// A boolean.
pub(super) fn flag(row: &Row, column: &str) -> Result<bool> {
    row.try_get(column)
}

pub(super) fn identity(row: &Row) -> Result<Identity> {
    Ok(Identity {
        patient_id: row.try_get("patient_id")?,
        issuer_of_patient_id: row.try_get("issuer_of_patient_id")?,
        patient_name: row.try_get("patient_name")?,
        patient_birth_date: row.try_get("patient_birth_date")?,
        patient_sex: row.try_get("patient_sex")?,
        accession_number: row.try_get("accession_number")?,
    })
}

pub(super) fn refused(row: &Row) -> Result<Refused> {
    Ok(Refused {
        sop_instance_uid: parsed(row, "sop_uid")?,
        study_instance_uid: maybe_parsed(row, "study_uid")?,
        held: flag(row, "held")?,
        code: row.try_get("code")?,
        times: number(row, "times")?,
        last_ms: row.try_get("last_ms")?,
    })
}

/// A sender and the series that it sends.
pub(super) fn open_sender(row: &Row) -> Result<(SeriesInstanceUid, OpenSender)> {
    let sender = OpenSender {
        id: parsed(row, "sender")?,
        begun: row.try_get("begun")?,
        is_upload: flag(row, "is_upload")?,
    };
    Ok((parsed(row, "series_uid")?, sender))
}

pub(super) fn broken_transfer(row: &Row) -> Result<BrokenTransfer> {
    Ok(BrokenTransfer {
        end: named(row, "sender_end", SenderEnd::from_name)?,
        missing: number(row, "missing")?,
    })
}

fn transfer_doubts(row: &Row) -> Result<Vec<TransferDoubt>> {
    let text: &str = row.try_get("transfer_doubts")?;
    let names = text.split(',').filter(|name| !name.is_empty());
    let doubt =
        |name| TransferDoubt::from_name(name).ok_or_else(|| decode_error("transfer_doubts", "unknown name"));
    let mut doubts: Vec<_> = names.map(doubt).collect::<Result<_>>()?;
    doubts.extend(is_of_former_decoder(row, "algorithm")?.then_some(TransferDoubt::FormerDecoder));
    Ok(doubts)
}

/// Whether the algorithm in that column is of version 0; see `identity.rs`.
fn is_of_former_decoder(row: &Row, column: &str) -> Result<bool> {
    Ok(row.try_get::<Option<&str>, _>(column)?.is_some_and(|algorithm| algorithm.ends_with("/0")))
}

pub(super) fn clinical_choice(row: &Row) -> Result<ClinicalChoice> {
    Ok(ClinicalChoice {
        revision: number(row, "revision")?,
        reconstruction: maybe_parsed(row, "reconstruction_id")?,
        chosen_by: row.try_get("chosen_by")?,
        chosen_ms: row.try_get("chosen_ms")?,
    })
}

/// Where the files of a result lie, and what they must be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ResultFiles {
    /// Prefix of their keys.
    pub(crate) prefix: String,
    /// `None`: of release 0.1.
    pub(crate) seal: Option<Seal>,
}

/// `None` without a result.
///
/// # Errors
/// [`Error::Unreadable`].
pub(super) fn result_files(row: &Row) -> Result<Option<ResultFiles>, Error> {
    let read = || {
        let Some(prefix) = row.try_get::<Option<String>, _>("result")? else { return Ok(None) };
        let seal = seal(row.try_get("result_files")?)?;
        Ok(Some(ResultFiles { prefix, seal }))
    };
    readable(read(), "reconstruction", row, "id")
}

/// The column `result_files`.
pub(super) fn seal(json: Option<&str>) -> Result<Option<Seal>> {
    let read =
        |json| Seal::from_json(json).ok_or_else(|| decode_error("result_files", "no names and hashes"));
    json.map(read).transpose()
}

/// # Errors
/// [`Error::Unreadable`].
pub(super) fn reconstruction(row: &Row) -> Result<ReconstructionRecord, Error> {
    readable(reconstruction_record(row), "reconstruction", row, "id")
}

fn reconstruction_record(row: &Row) -> Result<ReconstructionRecord> {
    let stage = |name: &str| Stage::ALL.into_iter().find(|stage| stage.name() == name);
    Ok(ReconstructionRecord {
        id: parsed(row, "id")?,
        series_instance_uid: parsed(row, "series_uid")?,
        revision: number(row, "revision")?,
        instances_sha256: sha256(row, "instances_sha256")?,
        instances: number(row, "instances")?,
        parameters: stored(row, "parameters", parameter_json::read)?,
        state: named(row, "state", ReconstructionState::from_name)?,
        stage: maybe_named(row, "stage", stage)?,
        fraction: row.try_get("fraction")?,
        attempts: number(row, "attempts")?,
        error_code: row.try_get("error_code")?,
        error_detail: row.try_get("error_detail")?,
        error_instances: uids(row, "error_instances")?,
        superseded_by: maybe_parsed(row, "superseded_by")?,
        software: row.try_get("software")?,
        algorithm: row.try_get("algorithm")?,
        figures: maybe_stored(row, "figures", figure_json::read)?,
        quality: maybe_stored(row, "quality", quality_json::read)?,
        transfer_doubts: transfer_doubts(row)?,
        has_report: row.try_get("has_report")?,
        has_pictures: row.try_get("has_pictures")?,
        created_ms: row.try_get("created_ms")?,
        started_ms: row.try_get("started_ms")?,
        finished_ms: row.try_get("finished_ms")?,
    })
}

/// One row more than a page was asked for: whether there is another page is known then. A row that
/// can't be understood takes its place beside the others.
pub(super) fn page<T>(
    rows: &[Row],
    limit: u32,
    record: impl Fn(&Row) -> Result<T, Error>,
    cursor: impl Fn(&Row) -> Result<String>,
) -> Result<crate::store::Page<T>, Error> {
    let limit = limit as usize;
    let (mut records, mut unreadable) = (Vec::new(), Vec::new());
    for row in rows.iter().take(limit) {
        match record(row) {
            Ok(record) => records.push(record),
            Err(Error::Unreadable { id, detail, .. }) => unreadable.push(UnreadableRow { id, detail }),
            Err(other) => return Err(other),
        }
    }
    let last = rows.get(limit.wrapping_sub(1)).filter(|_| rows.len() > limit);
    let next_cursor = last.map(cursor).transpose()?;
    Ok(crate::store::Page { rows: records, unreadable, next_cursor })
}
