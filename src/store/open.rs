//! Opening a data directory: one service at a time, one schema, a row for every blob.

use std::fs::{self, File, TryLockError};
use std::io;
use std::os::unix::fs::DirBuilderExt as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use tokio::sync::Mutex;

use super::blobs::{Aside, Blobs as _, Files};
use super::catalog::{Catalog, SchemaError, now_ms};
use super::recovery::{MissingInstances, Recovered, Recovery};
use super::{Counts, Inner, Store, blocking};
use crate::config;
use crate::error::Error;

/// Locked while a service uses the data directory, beside the directory itself: version 0.1 looks
/// at this file alone.
const LOCK: &str = "lock";
/// The catalog's file.
pub(super) const CATALOG: &str = "catalog.sqlite";

const DAY_S: i64 = 86_400;

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
    /// There are instances or results, and no catalog.
    #[error(
        "the data directory {path} holds instances or results, but its catalog ({CATALOG}) is missing, empty or \
         damaged (`triplanar check --data-dir {path}` says more): bring the catalog back from a backup, with \
         {CATALOG}-wal and {CATALOG}-shm removed first unless they are of the same backup, or make a new one from \
         the files with `triplanar rebuild --data-dir {path}`",
        path = .0.display()
    )]
    CatalogLost(PathBuf),
    /// The log beside the catalog is that of another catalog.
    #[error(
        "the log {CATALOG}-wal in the data directory {path} is not that of the {CATALOG} beside it, as after a \
         catalog was brought back from a backup; nothing was changed. Remove {CATALOG}-wal and {CATALOG}-shm if \
         that {CATALOG} is the one to go on with (instances and results that came after it are entered from their \
         files), or bring back the {CATALOG} of that log, or make a new one from the files with `triplanar rebuild \
         --data-dir {path}`",
        path = .0.display()
    )]
    ForeignLog(PathBuf),
    /// A catalog is there that need not be rebuilt.
    #[error(
        "the catalog of {} can be opened and is not empty: start the service, or add --replace to set it aside and \
         make a new one",
        .0.display()
    )]
    InUse(PathBuf),
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

impl OpenError {
    /// What went wrong inside with rows and files, told with its cause.
    pub(super) fn from_rows(path: &Path, error: Error) -> Self {
        match error {
            Error::CatalogDamaged => Self::CatalogLost(path.to_owned()),
            Error::Internal(cause) => Self::Unusable { path: path.to_owned(), cause },
            error => Self::Unusable { path: path.to_owned(), cause: error.into() },
        }
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
        let files = Arc::new(files);
        let file = config.data_dir.join(CATALOG);
        let (kept, path) = (Arc::clone(&files), file.clone());
        let may_be_new = blocking(move || Ok(kept.keys().map_err(Error::internal)?.is_empty())).await;
        let may_be_new = may_be_new.map_err(|error| OpenError::from_rows(&config.data_dir, error))?;
        if path.is_dir() {
            return Err(OpenError::CatalogLost(config.data_dir.clone()));
        }
        if !may_be_new && fs::metadata(path).map_or(0, |metadata| metadata.len()) == 0 {
            return Err(OpenError::CatalogLost(config.data_dir.clone()));
        }
        let catalog = Catalog::open(&file, may_be_new).await.map_err(|error| match error {
            SchemaError::Newer { found, known } => {
                OpenError::Newer { path: config.data_dir.clone(), found, known }
            }
            SchemaError::Lost => OpenError::CatalogLost(config.data_dir.clone()),
            SchemaError::ForeignLog => OpenError::ForeignLog(config.data_dir.clone()),
            SchemaError::Database(error) if is_damage(&error) => {
                OpenError::CatalogLost(config.data_dir.clone())
            }
            SchemaError::Database(error) => unusable(error.into()),
            SchemaError::Damaged(found) => {
                tracing::error!(found, "the catalog is damaged");
                OpenError::CatalogLost(config.data_dir.clone())
            }
            SchemaError::Rows(error) => OpenError::from_rows(&config.data_dir, error),
        })?;
        let store = Self(Arc::new(Inner {
            catalog,
            incoming: files.incoming(),
            blobs: files,
            aside: Aside::of(&config.data_dir),
            settings: config.clone(),
            readiness: Mutex::default(),
            damaged: AtomicBool::new(false),
            counts: Counts::default(),
            lock,
        }));
        let failed = |error| OpenError::from_rows(&config.data_dir, error);
        store.remove_replaced(true).await.map_err(failed)?;
        store.recover().await.map_err(failed)?;
        Ok(store)
    }

    /// Removes blobs that were to be removed, gives the others without a row their row or sets them
    /// aside.
    async fn recover(&self) -> crate::error::Result<()> {
        self.remove_noted().await?;
        let (catalog, blobs) = (&self.0.catalog, Arc::clone(&self.0.blobs));
        let recovery = Recovery { catalog, blobs, aside: self.0.aside.clone() };
        let recovered = recovery.run().await?;
        self.0.counts.entered.fetch_add(recovered.rows(), Ordering::Relaxed);
        for blob in &recovered.set_aside {
            tracing::warn!(path = blob.path, reason = blob.reason, "a blob without a row was set aside");
        }
        let partly = recovered.missing_instances.iter().filter(|missing| missing.stored > 0);
        for MissingInstances { series_instance_uid, stored, lost } in partly {
            let lost = lost.len();
            tracing::error!(
                series = series_instance_uid,
                stored,
                lost,
                "no file holds instances that a result was made from"
            );
        }
        if recovered != Recovered::default() {
            tracing::warn!(
                instances = recovered.instances,
                repaired = recovered.repaired,
                corrected = recovered.corrected,
                results = recovered.results,
                set_aside = recovered.set_aside.len(),
                "files without a row in the catalog: an interrupted process left them, or the catalog is older \
                 than they are; what could be entered was entered"
            );
        }
        self.bound_set_aside().await
    }

    /// Keeps `set-aside/` within its limits.
    pub(super) async fn bound_set_aside(&self) -> crate::error::Result<()> {
        let aside = self.0.aside.clone();
        let (days, bytes) = (self.0.settings.set_aside_days, self.0.settings.set_aside_bytes);
        let now_s = now_ms() / 1000;
        let (kept, removed) =
            blocking(move || Ok(aside.bound(now_s, i64::from(days) * DAY_S, bytes)?)).await?;
        self.0.counts.set_aside_files.store(kept.files, Ordering::Relaxed);
        self.0.counts.set_aside_bytes.store(kept.bytes, Ordering::Relaxed);
        if removed > 0 {
            tracing::warn!(
                removed,
                "removed what was set aside, by storage.set_aside_days and set_aside_bytes"
            );
        }
        Ok(())
    }
}

/// Whether the file is no database, or a broken one (SQLITE_CORRUPT, SQLITE_NOTADB).
pub(super) fn is_damage(error: &sqlx::Error) -> bool {
    let code = error.as_database_error().and_then(|error| error.code());
    code.and_then(|code| code.parse::<i32>().ok()).is_some_and(|code| matches!(code & 0xFF, 11 | 26))
}

/// The locks of a data directory, held as long as they live.
#[derive(Debug)]
pub(super) struct Locks {
    file: File,
    directory: File,
}

impl Locks {
    /// Another process may take them.
    pub(super) fn release(&self) -> io::Result<()> {
        self.directory.unlock()?;
        self.file.unlock()
    }
}

/// The locked folder with its subfolders.
pub(super) fn prepare(root: &Path) -> Result<(Locks, Files), OpenError> {
    let unusable = |cause: io::Error| OpenError::Unusable { path: root.to_owned(), cause: cause.into() };
    make_root(root).map_err(unusable)?;
    let directory = File::open(root).map_err(unusable)?;
    match directory.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => return Err(OpenError::Locked(root.to_owned())),
        // A file system (NFS) on which a directory can't be locked: the file's lock must do.
        Err(TryLockError::Error(cause)) => {
            tracing::warn!(%cause, "the data directory itself can't be locked")
        }
    }
    let file =
        File::options().create(true).truncate(false).write(true).open(root.join(LOCK)).map_err(unusable)?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => return Err(OpenError::Locked(root.to_owned())),
        Err(TryLockError::Error(cause)) => return Err(unusable(cause)),
    }
    let files = Files::open(root).map_err(unusable)?;
    Ok((Locks { file, directory }, files))
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
