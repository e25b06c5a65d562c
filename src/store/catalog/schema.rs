//! Brings the schema to this version, step by step, and refuses one from the future.

use sqlx::Connection as _;

use super::dialect::{BEGIN_WRITING, Connection, MIGRATIONS};

/// Why the catalog can't be opened.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SchemaError {
    /// Made by a later version of the software.
    #[error("schema version {found} is newer than this software's {known}")]
    Newer {
        /// Its version.
        found: i64,
        /// The latest one known here.
        known: i64,
    },
    /// It holds nothing although it must.
    #[error("the catalog is empty")]
    Lost,
    /// Pages or indices are not what they must be.
    #[error("the catalog is damaged: {0}")]
    Damaged(String),
    /// The log beside it is that of another file.
    #[error("the log beside the catalog is that of another catalog")]
    ForeignLog,
    /// The database's own error.
    #[error(transparent)]
    Database(#[from] sqlx::Error),
    /// Rows of another version can't be brought to this one.
    #[error(transparent)]
    Rows(#[from] crate::error::Error),
}

/// Runs the steps that are missing, all in one transaction. A catalog without any is new, which
/// `may_be_new` allows or not.
pub(super) async fn migrate(connection: &mut Connection, may_be_new: bool) -> Result<(), SchemaError> {
    let mut tx = connection.begin_with(BEGIN_WRITING).await?;
    sqlx::query("CREATE TABLE IF NOT EXISTS schema_version (version BIGINT NOT NULL)")
        .execute(&mut *tx)
        .await?;
    let done: Vec<i64> = sqlx::query_scalar("SELECT version FROM schema_version").fetch_all(&mut *tx).await?;
    let found = done.iter().copied().max().unwrap_or(0);
    let known = latest();
    if found > known {
        return Err(SchemaError::Newer { found, known });
    }
    if done.is_empty() && !may_be_new {
        return Err(SchemaError::Lost);
    }
    for (version, sql) in MIGRATIONS.iter().filter(|(version, _)| !done.contains(version)) {
        sqlx::raw_sql(*sql).execute(&mut *tx).await?;
        sqlx::query("INSERT INTO schema_version (version) VALUES ($1)")
            .bind(version)
            .execute(&mut *tx)
            .await?;
        tracing::info!(version, "catalog schema migrated");
    }
    Ok(tx.commit().await?)
}

/// The number of the last step.
pub(super) fn latest() -> i64 {
    MIGRATIONS.iter().map(|step| step.0).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::super::Catalog;
    use super::*;

    #[tokio::test]
    async fn opening_twice_migrates_once() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("catalog.sqlite");
        Catalog::open(&file, true).await.unwrap().close().await;
        let catalog = Catalog::open(&file, true).await.unwrap();
        let steps: i64 = sqlx::query_scalar("SELECT COUNT(*) FROM schema_version")
            .fetch_one(&catalog.readers)
            .await
            .unwrap();
        assert_eq!(steps, i64::try_from(MIGRATIONS.len()).unwrap());
    }

    #[tokio::test]
    async fn a_newer_schema_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("catalog.sqlite");
        let catalog = Catalog::open(&file, true).await.unwrap();
        sqlx::query("INSERT INTO schema_version (version) VALUES (999)")
            .execute(&catalog.writer)
            .await
            .unwrap();
        catalog.close().await;
        let error = Catalog::open(&file, true).await.unwrap_err();
        assert!(matches!(error, SchemaError::Newer { found: 999, .. }), "{error}");
    }
}
