//! Whether there is room, and whether the store can work.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::{Store, blocking};
use crate::error::{Error, Result};

/// How long an answer about readiness stands before the disk is written again to find out.
const STANDS: Duration = Duration::from_secs(5);

/// Bytes written to see whether the data directory takes any.
const PROBE: [u8; 4096] = [0; 4096];

/// Whether what the store stands on answers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Readiness {
    /// The catalog: it takes a row; the error without any row's content.
    pub catalog: Result<(), String>,
    /// The data directory: writable, and above the watermark of free space.
    pub data_dir: Result<(), String>,
}

/// The last answer.
pub(super) type Last = Option<(Instant, Readiness)>;

impl Store {
    /// Asks what the store stands on whether it answers. Writes to find out, at most once in 5 s.
    pub async fn ready(&self) -> Readiness {
        let mut last = self.0.readiness.lock().await;
        let mut readiness = match &*last {
            Some((when, readiness)) if when.elapsed() < STANDS => readiness.clone(),
            _ => {
                let readiness = self.try_all().await;
                *last = Some((Instant::now(), readiness.clone()));
                readiness
            }
        };
        drop(last);
        if readiness.data_dir.is_ok() {
            readiness.data_dir = match self.has_room() {
                Ok(true) => Ok(()),
                Ok(false) => Err(Error::OutOfStorage.to_string()),
                Err(_) => Err("the data directory's free space can't be read".to_owned()),
            };
        }
        readiness
    }

    async fn try_all(&self) -> Readiness {
        let catalog = match self.0.catalog.ping().await {
            Err(_) => Err("the catalog does not answer".to_owned()),
            Ok(()) if self.is_damaged().await => Err(Error::CatalogDamaged.to_string()),
            Ok(()) => self.0.catalog.try_write().await.map_err(|error| match error {
                Error::Internal(_) => "the catalog can't be written".to_owned(),
                error => format!("the catalog can't be written: {error}"),
            }),
        };
        let blobs = Arc::clone(&self.0.blobs);
        let written = blocking(move || Ok(blobs.try_write(&PROBE).err())).await;
        let data_dir = match written {
            Ok(None) => Ok(()),
            Ok(Some(error)) => Err(format!("the data directory can't be written: {error}")),
            Err(_) => Err("the data directory can't be written".to_owned()),
        };
        Readiness { catalog, data_dir }
    }

    /// Whether the catalog's pages are found damaged; intake follows that.
    async fn is_damaged(&self) -> bool {
        let damaged = match self.0.catalog.damage().await {
            Ok(None) => false,
            Ok(Some(found)) => {
                tracing::error!(found, "the catalog is damaged");
                true
            }
            Err(error) => matches!(error, Error::CatalogDamaged),
        };
        self.0.damaged.store(damaged, Ordering::Relaxed);
        damaged
    }

    /// Refuses what would be stored into a catalog that is known to be damaged.
    ///
    /// # Errors
    /// [`Error::CatalogDamaged`].
    pub(crate) fn check_catalog(&self) -> Result<()> {
        if self.0.damaged.load(Ordering::Relaxed) { Err(Error::CatalogDamaged) } else { Ok(()) }
    }

    /// An error was met: if it tells of damage, that is known from now on.
    pub(crate) fn note_damage(&self, error: &Error) {
        if matches!(error, Error::CatalogDamaged) {
            self.0.damaged.store(true, Ordering::Relaxed);
        }
    }

    /// Free bytes on the disk of the data directory.
    ///
    /// # Errors
    /// The file system does not tell.
    pub fn free_bytes(&self) -> Result<u64> {
        let disk = rustix::fs::statvfs(&self.0.settings.data_dir).map_err(std::io::Error::from)?;
        Ok(disk.f_bavail.saturating_mul(disk.f_frsize))
    }

    /// Whether the free space is above the watermark.
    pub(crate) fn has_room(&self) -> Result<bool> {
        Ok(self.free_bytes()? >= self.0.settings.min_free_bytes)
    }

    /// Refuses `bytes` that would take the free space below the watermark: what is left there is
    /// the catalog's and the results'.
    ///
    /// # Errors
    /// [`Error::OutOfStorage`].
    pub(crate) fn check_room(&self, bytes: u64) -> Result<()> {
        let left = self.free_bytes()?.saturating_sub(bytes);
        if left >= self.0.settings.min_free_bytes { Ok(()) } else { Err(Error::OutOfStorage) }
    }
}
