//! Opening a data directory: one service at a time, one schema, nothing left over from a crash.

use std::collections::HashSet;
use std::fs::{self, File, TryLockError};
use std::io;
use std::os::unix::fs::DirBuilderExt as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::blobs::Files;
use super::catalog::{Catalog, SchemaError};
use super::{Inner, Store, blocking};
use crate::config;
use crate::error::Error;

/// Locked while a service uses the data directory.
const LOCK: &str = "lock";
/// The catalog's file.
const CATALOG: &str = "catalog.sqlite";

/// Why a data directory can't be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Another service uses it.
    #[error(
        "the data directory {} is in use by another service: stop that one, or set storage.data_dir to another \
         directory",
        .0.display()
    )]
    Locked(PathBuf),
    /// It was used by a later version.
    #[error(
        "the data directory {} was written by a newer version (catalog schema {found}, this software knows \
         {known}): run that version or a later one",
        path.display()
    )]
    Newer {
        /// The data directory.
        path: PathBuf,
        /// The catalog's schema version.
        found: i64,
        /// The latest one known here.
        known: i64,
    },
    /// It can't be made, read or written.
    #[error("the data directory {} can't be used (storage.data_dir): {cause}", path.display())]
    Unusable {
        /// The data directory.
        path: PathBuf,
        /// Why.
        cause: Box<dyn std::error::Error + Send + Sync>,
    },
}

impl From<OpenError> for Error {
    fn from(error: OpenError) -> Self {
        Self::internal(error)
    }
}

impl Store {
    /// Opens the data directory: makes it if it is missing, locks it against a second service,
    /// brings the catalog to this version's schema, removes what a crash left behind.
    ///
    /// # Errors
    /// See [`OpenError`].
    pub async fn open(config: &config::Storage) -> Result<Self, OpenError> {
        let root = config.data_dir.clone();
        let unusable = |cause: Box<dyn std::error::Error + Send + Sync>| OpenError::Unusable {
            path: config.data_dir.clone(),
            cause,
        };
        let (lock, files) =
            blocking(move || Ok(prepare(&root))).await.map_err(|error| unusable(error.into()))??;
        let catalog = Catalog::open(&config.data_dir.join(CATALOG)).await.map_err(|error| match error {
            SchemaError::Newer { found, known } => {
                OpenError::Newer { path: config.data_dir.clone(), found, known }
            }
            SchemaError::Database(error) => unusable(error.into()),
            SchemaError::Rows(error) => unusable(error.into()),
        })?;
        let store = Self(Arc::new(Inner {
            catalog,
            incoming: files.incoming(),
            blobs: Arc::new(files),
            settings: config.clone(),
            lock,
        }));
        store.remove_replaced(true).await.map_err(|error| unusable(error.into()))?;
        store.remove_orphans().await.map_err(|error| unusable(error.into()))?;
        Ok(store)
    }

    /// Removes blobs that no row names: a crash came between the two.
    async fn remove_orphans(&self) -> crate::error::Result<()> {
        let (instances, results) = self.0.catalog.named_blobs().await?;
        let blobs = Arc::clone(&self.0.blobs);
        let removed = blocking(move || {
            let instances: HashSet<String> = instances.into_iter().collect();
            let results: HashSet<String> = results.into_iter().collect();
            let mut removed = 0_usize;
            for key in blobs.keys()? {
                let is_result = key.rsplit_once('/').is_some_and(|(prefix, _)| results.contains(prefix));
                if !is_result && !instances.contains(&key) {
                    blobs.remove(&key)?;
                    removed += 1;
                }
            }
            Ok(removed)
        })
        .await?;
        if removed > 0 {
            tracing::info!(removed, "removed blobs that an interrupted process left behind");
        }
        Ok(())
    }
}

/// The locked folder with its subfolders.
fn prepare(root: &Path) -> Result<(File, Files), OpenError> {
    let unusable = |cause: io::Error| OpenError::Unusable { path: root.to_owned(), cause: cause.into() };
    make_root(root).map_err(unusable)?;
    let lock =
        File::options().create(true).truncate(false).write(true).open(root.join(LOCK)).map_err(unusable)?;
    match lock.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => return Err(OpenError::Locked(root.to_owned())),
        Err(TryLockError::Error(cause)) => return Err(unusable(cause)),
    }
    let files = Files::open(root).map_err(unusable)?;
    Ok((lock, files))
}

/// Makes the data directory, for its owner's eyes only, so that a power cut can't take it away
/// again.
fn make_root(root: &Path) -> io::Result<()> {
    if root.is_dir() {
        return Ok(());
    }
    if let Some(parent) = root.parent().filter(|parent| !parent.as_os_str().is_empty()) {
        make_root(parent)?;
    }
    match fs::DirBuilder::new().mode(0o700).create(root) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(error),
        _ => {}
    }
    let parent = root.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    File::open(parent)?.sync_all()
}
