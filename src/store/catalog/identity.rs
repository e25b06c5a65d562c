//! Identities of rows that another version wrote: brought to this version's when the catalog is
//! opened, so that what was made is found again.

use sqlx::{Connection as _, Row as _};

use super::dialect::{BEGIN_WRITING, Connection};
use crate::error::{Error, Result};
use crate::pipeline::Parameters;
use crate::store::stored::{identity_sha256, parameter_json, settings_sha256};

/// Enters the algorithm of rows of 0.1 (their version is 1), and lets what still waits be run, under
/// its id, by this version.
pub(super) async fn refresh(connection: &mut Connection) -> Result<()> {
    let mut tx = connection.begin_with(BEGIN_WRITING).await?;
    let found = sqlx::query(
        "SELECT id, parameters, algorithm, state FROM reconstructions \
         WHERE algorithm IS NULL OR state IN ('queued', 'running') ORDER BY id",
    )
    .fetch_all(&mut *tx)
    .await?;
    for row in found {
        let (id, json): (String, String) = (row.try_get("id")?, row.try_get("parameters")?);
        let algorithm: Option<&str> = row.try_get("algorithm")?;
        let state: &str = row.try_get("state")?;
        let Ok(parameters) = parameter_json::read(&json) else {
            tracing::error!(reconstruction = id, "its parameters can't be read by this version");
            continue;
        };
        let now = parameters.profile.algorithm();
        let waits = matches!(state, "queued" | "running");
        if algorithm == Some(now) {
            continue;
        }
        let of_0_1 = format!("{}/1", parameters.profile.name());
        let made_by = if waits { now } else { of_0_1.as_str() };
        set(&mut tx, &id, made_by, &parameters).await?;
        if waits {
            sqlx::query("UPDATE reconstructions SET software = $2 WHERE id = $1")
                .bind(&id)
                .bind(crate::SOFTWARE)
                .execute(&mut *tx)
                .await?;
        }
    }
    Ok(tx.commit().await?)
}

/// Another row may have that identity: then this one is served by its id alone.
async fn set(connection: &mut Connection, id: &str, algorithm: &str, parameters: &Parameters) -> Result<()> {
    sqlx::query("UPDATE reconstructions SET algorithm = $2, settings_sha256 = $3 WHERE id = $1")
        .bind(id)
        .bind(algorithm)
        .bind(settings_sha256(parameters).as_slice())
        .execute(&mut *connection)
        .await?;
    if algorithm != parameters.profile.algorithm() {
        return Ok(());
    }
    sqlx::query(
        "UPDATE reconstructions SET parameters_sha256 = $2 WHERE id = $1 AND NOT EXISTS ( \
         SELECT 1 FROM reconstructions other WHERE other.series_uid = reconstructions.series_uid \
         AND other.instances_sha256 = reconstructions.instances_sha256 AND other.parameters_sha256 = $2 \
         AND other.id <> $1)",
    )
    .bind(id)
    .bind(identity_sha256(parameters).as_slice())
    .execute(connection)
    .await
    .map(drop)
    .map_err(Error::from)
}
