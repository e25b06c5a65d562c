//! Identities of rows that another version wrote: brought to this version's when the catalog is
//! opened, so that what was made is found again.

use sha2::{Digest as _, Sha256};
use sqlx::{Connection as _, Row as _};

use super::dialect::{BEGIN_WRITING, Connection};
use crate::error::{Error, Result};
use crate::pipeline::Parameters;
use crate::store::stored::{identity_sha256, parameter_json, settings_sha256};

/// Enters the algorithm of rows of 0.1 (their version is 1, and 0 where their decoder was, or may have been,
/// at fault), and lets what still waits be run, under its id, by this version.
pub(super) async fn refresh(connection: &mut Connection) -> Result<()> {
    let mut tx = connection.begin_with(BEGIN_WRITING).await?;
    let found = sqlx::query(
        "SELECT id, parameters, algorithm, state, EXISTS ( \
         SELECT 1 FROM instances i WHERE i.series_uid = reconstructions.series_uid \
         AND i.transfer_syntax_uid IN ('1.2.840.10008.1.2.4.57', '1.2.840.10008.1.2.4.70')) \
         OR (state IN ('succeeded', 'superseded') AND NOT EXISTS ( \
         SELECT 1 FROM instances i WHERE i.series_uid = reconstructions.series_uid)) AS lossless_jpeg \
         FROM reconstructions WHERE algorithm IS NULL OR state IN ('queued', 'running') ORDER BY id",
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
        // The decoder of 0.1 read some streams of JPEG Lossless wrongly, without an error: what was made
        // with it counts as of another algorithm, so that asking again makes it again. Of instances that are
        // no longer stored nobody knows what they were.
        let lossless_jpeg: bool = row.try_get("lossless_jpeg")?;
        let of_0_1 = format!("{}/{}", parameters.profile.name(), if lossless_jpeg { 0 } else { 1 });
        let made_by = if waits { now } else { of_0_1.as_str() };
        set(&mut tx, &id, made_by, &parameters).await?;
        if !waits && lossless_jpeg {
            former_decoder(&mut tx, &id, &parameters).await?;
        }
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

/// What this version would make of the same instances is not it.
async fn former_decoder(connection: &mut Connection, id: &str, parameters: &Parameters) -> Result<()> {
    let identity = Sha256::new_with_prefix(identity_sha256(parameters)).chain_update("decoded by 0.1");
    sqlx::query("UPDATE reconstructions SET parameters_sha256 = $2 WHERE id = $1")
        .bind(id)
        .bind(identity.finalize().as_slice())
        .execute(connection)
        .await?;
    tracing::warn!(
        reconstruction = id,
        "made from JPEG Lossless by release 0.1, whose decoder could read it wrongly: ask for it again"
    );
    Ok(())
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
