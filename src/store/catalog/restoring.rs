//! What records beside the results tell of a series whose row was made again: how it was completed,
//! which instances were refused, how many came again with other attributes, what operators chose, which corrections of its identity are under way.

use std::collections::BTreeSet;

use super::dialect::Connection;
use super::dump::{self, Columns};
use super::instances::set_sha256;
use super::{Catalog, clinical, identity, rows, series, transfers};
use crate::dicom::identity::{Identity, IdentityField};
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::{Error, Result};
use crate::store::records::{InstanceRecord, SeriesState};
use crate::store::recovery::ResultRecord;
use serde_json::Value;

/// The columns of a series that say how its sender ended, and whether it is in doubt.
const TRANSFER: [&str; 3] = ["sender_end", "incomplete_transfer", "short_of_expected"];
/// Those that say how it was completed.
const COMPLETION: [&str; 3] = ["state", "unfit_reason", "complete_reason"];

/// If the instances of the series are exactly those that the result was made from, it is as complete, and
/// as much in doubt, as it was when the result was stored; else it stays receiving, and in doubt. Without
/// the service's own reconstruction it stays receiving too, and gets that after the quiet time. The number
/// that was expected comes back.
pub(super) async fn completeness(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    record: &ResultRecord,
) -> Result<()> {
    if let Some(expected) = record.expected_instances {
        sqlx::query(
            "INSERT INTO expectations (series_uid, expected_instances, set_ms) VALUES ($1, $2, 0) \
             ON CONFLICT (series_uid) DO NOTHING",
        )
        .bind(uid.as_str())
        .bind(expected)
        .execute(&mut *connection)
        .await?;
    }
    refusals(connection, uid, &record.refused).await?;
    attribute_changes(connection, uid, &record.attribute_changes).await?;
    let Some(now) = series::one(connection, uid).await? else { return Ok(()) };
    if now.state != SeriesState::Receiving {
        return Ok(());
    }
    let stored = sqlx::query("SELECT * FROM instances WHERE series_uid = $1").bind(uid.as_str());
    let stored = stored.fetch_all(&mut *connection).await?;
    let stored: Vec<InstanceRecord> = stored.iter().map(rows::instance).collect::<Result<_, _>>()?;
    let set = dump::bytes(&set_sha256(&stored));
    let was = record.series.get("state").and_then(Value::as_str).unwrap_or(SeriesState::Receiving.name());
    if was == SeriesState::Receiving.name()
        || record.series.get("instances_sha256") != Some(&set)
        || record.reconstruction.get("instances_sha256") != Some(&set)
    {
        return Ok(());
    }
    let is_own = record.reconstruction.get("queued_for").is_some_and(|revision| !revision.is_null());
    // Results come the latest first: what that told of the transfer stands.
    let transfer = TRANSFER.iter().filter(|_| now.sender_end.is_none());
    let known: Columns = transfer
        .chain(COMPLETION.iter().filter(|_| is_own))
        .filter_map(|name| record.series.get(*name).map(|value| ((*name).to_owned(), value.clone())))
        .collect();
    dump::update(connection, "series", &known, ("series_uid", uid.as_str())).await?;
    transfers::restored(connection, uid).await
}

/// Results come the latest first: what that told of a refusal stands. One of an instance that is stored now
/// is no doubt, unless it came with other content than is stored.
async fn refusals(connection: &mut Connection, uid: &SeriesInstanceUid, refused: &[Columns]) -> Result<()> {
    for row in refused {
        let text = |name: &str| row.get(name).and_then(Value::as_str);
        let known: i64 = sqlx::query_scalar(
            "SELECT COUNT(*) FROM refused WHERE series_uid = $1 AND sop_uid = $2 AND code = $3",
        )
        .bind(uid.as_str())
        .bind(text("sop_uid"))
        .bind(text("code"))
        .fetch_one(&mut *connection)
        .await?;
        if known == 0 && text("series_uid") == Some(uid.as_str()) {
            dump::insert(connection, "refused", row).await?;
        }
    }
    sqlx::query(
        "UPDATE refused SET held = FALSE WHERE series_uid = $1 AND held AND code NOT LIKE 'conflicting-%' AND EXISTS ( \
         SELECT 1 FROM instances i WHERE i.sop_uid = refused.sop_uid AND i.series_uid = refused.series_uid)",
    )
    .bind(uid.as_str())
    .execute(connection)
    .await?;
    Ok(())
}

/// Results come the latest first: what that told of corrected attributes stands.
async fn attribute_changes(
    connection: &mut Connection,
    uid: &SeriesInstanceUid,
    changes: &[Columns],
) -> Result<()> {
    let known: i64 = sqlx::query_scalar("SELECT COUNT(*) FROM attribute_changes WHERE series_uid = $1")
        .bind(uid.as_str())
        .fetch_one(&mut *connection)
        .await?;
    let is_own = |row: &&Columns| row.get("series_uid").and_then(Value::as_str) == Some(uid.as_str());
    for row in changes.iter().filter(|_| known == 0).filter(is_own) {
        dump::insert(connection, "attribute_changes", row).await?;
    }
    Ok(())
}

impl Catalog {
    /// Ends the entering of results: what 0.1 made (`of_0_1`: prefixes of results) gets its identity, and of
    /// each revision the earliest one the place of the service's own (0.1 queued that itself); of several succeeded ones of a
    /// series with the same parameters, that of the highest revision supersedes the others.
    pub(crate) async fn settle_results(&self, of_0_1: &[String]) -> Result<()> {
        let of_0_1 = serde_json::to_string(of_0_1).map_err(Error::internal)?;
        identity::refresh(&mut *self.writer.acquire().await?).await?;
        let mut tx = self.begin().await?;
        sqlx::query(
            "UPDATE reconstructions SET queued_for = revision WHERE revision > 0 AND id = ( \
             SELECT MIN(other.id) FROM reconstructions other WHERE other.series_uid = reconstructions.series_uid \
             AND other.revision = reconstructions.revision AND other.result IN (SELECT value FROM json_each($1))) \
             AND NOT EXISTS (SELECT 1 FROM reconstructions r WHERE r.series_uid = reconstructions.series_uid \
             AND r.queued_for = reconstructions.revision)",
        )
        .bind(of_0_1)
        .execute(&mut *tx)
        .await?;
        sqlx::query(
            "UPDATE reconstructions SET state = 'superseded', superseded_by = \
             (SELECT r.id FROM reconstructions r WHERE r.series_uid = reconstructions.series_uid \
              AND r.settings_sha256 = reconstructions.settings_sha256 AND r.state = 'succeeded' \
              AND r.revision > reconstructions.revision ORDER BY r.revision DESC LIMIT 1) \
             WHERE state = 'succeeded' AND EXISTS \
             (SELECT 1 FROM reconstructions r WHERE r.series_uid = reconstructions.series_uid \
              AND r.settings_sha256 = reconstructions.settings_sha256 AND r.state = 'succeeded' \
              AND r.revision > reconstructions.revision)",
        )
        .execute(&mut *tx)
        .await?;
        Ok(tx.commit().await?)
    }

    /// Enters choices that the catalog does not know, and lets the last one of each revision stand.
    pub(crate) async fn enter_choices(&self, choices: &[Columns]) -> Result<()> {
        let mut tx = self.begin().await?;
        let mut touched = BTreeSet::new();
        for choice in choices {
            let text = |name: &str| choice.get(name).and_then(Value::as_str);
            let number = |name: &str| choice.get(name).and_then(Value::as_i64);
            let (Some(uid), Some(revision), Some(chosen_ms)) =
                (text("series_uid"), number("revision"), number("chosen_ms"))
            else {
                continue;
            };
            let known: i64 = sqlx::query_scalar(
                "SELECT COUNT(*) FROM clinical_choices WHERE series_uid = $1 AND revision = $2 AND chosen_ms = $3 \
                 AND COALESCE(reconstruction_id, '') = COALESCE($4, '')",
            )
            .bind(uid)
            .bind(revision)
            .bind(chosen_ms)
            .bind(text("reconstruction_id"))
            .fetch_one(&mut *tx)
            .await?;
            let series: i64 = sqlx::query_scalar("SELECT COUNT(*) FROM series WHERE series_uid = $1")
                .bind(uid)
                .fetch_one(&mut *tx)
                .await?;
            if known == 0 && series > 0 {
                dump::insert(&mut tx, "clinical_choices", choice).await?;
                touched.insert(uid);
            }
        }
        for uid in touched {
            sqlx::query("UPDATE reconstructions SET chosen_for = NULL WHERE series_uid = $1")
                .bind(uid)
                .execute(&mut *tx)
                .await?;
            let all: Vec<(i64, Option<String>)> = sqlx::query_as(
                "SELECT revision, reconstruction_id FROM clinical_choices WHERE series_uid = $1 ORDER BY chosen_ms",
            )
            .bind(uid)
            .fetch_all(&mut *tx)
            .await?;
            for (revision, id) in all {
                clinical::choose(&mut tx, uid, revision, id.as_deref()).await?;
            }
        }
        Ok(tx.commit().await?)
    }

    /// Of the instances that were entered, some have a corrected identity and others another one: the
    /// change is still under way. The corrected ones are confirmed.
    pub(crate) async fn restore_identity_changes(&self) -> Result<()> {
        let mut tx = self.begin().await?;
        let corrected: Vec<String> = sqlx::query_scalar(
            "SELECT series_uid FROM series WHERE identity_round = 0 AND EXISTS (SELECT 1 FROM instances i \
             WHERE i.series_uid = series.series_uid AND i.image_sha256 IS NOT NULL)",
        )
        .fetch_all(&mut *tx)
        .await?;
        for uid in corrected {
            let found = sqlx::query(
                "SELECT DISTINCT patient_id, issuer_of_patient_id, patient_name, patient_birth_date, patient_sex, \
                 accession_number FROM instances WHERE series_uid = $1",
            )
            .bind(&uid)
            .fetch_all(&mut *tx)
            .await?;
            let identities: Vec<Identity> = found.iter().map(rows::identity).collect::<Result<_, _>>()?;
            let differs: BTreeSet<IdentityField> = identities
                .iter()
                .flat_map(|identity| {
                    identities.first().map(|first| first.changed(identity)).unwrap_or_default()
                })
                .collect();
            if differs.is_empty() {
                continue;
            }
            let names: Vec<&str> = differs.iter().map(|field| field.name()).collect();
            sqlx::query("UPDATE series SET identity_round = 1, identity_changing = $2 WHERE series_uid = $1")
                .bind(&uid)
                .bind(names.join(","))
                .execute(&mut *tx)
                .await?;
            sqlx::query(
                "UPDATE instances SET identity_round = 1 WHERE series_uid = $1 AND image_sha256 IS NOT NULL",
            )
            .bind(&uid)
            .execute(&mut *tx)
            .await?;
        }
        Ok(tx.commit().await?)
    }
}
