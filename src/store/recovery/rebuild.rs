//! `triplanar rebuild`: a new catalog from what the blobs say.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;

use super::{Recovered, Recovery};
use crate::config;
use crate::store::blobs::Aside;
use crate::store::catalog::{Catalog, SchemaError, files_of, now_ms};
use crate::store::open::{CATALOG, OpenError, prepare};
use crate::store::{Store, blocking};

/// The catalog while it is made.
const UNFINISHED: &str = "catalog.sqlite.rebuilding";

/// What `Store::rebuild` made.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Rebuilt {
    /// Series in the new catalog.
    pub series: i64,
    /// Reconstructions in it.
    pub reconstructions: i64,
    /// The blobs.
    #[serde(flatten)]
    pub blobs: Recovered,
    /// Where the former catalog is now, below `set-aside/`, if there was one.
    pub former_catalog: Option<String>,
    /// What no file holds.
    pub lost: &'static [&'static str],
}

/// What no file of a data directory holds beside the catalog.
const LOST: &[&str] = &[
    "reconstructions that waited or ran, failed without a report, or were cancelled: ask for them again",
    "numbers of expected instances that no result was stored after",
    "refusals of instances that no result was stored after",
    "changes of a reconstruction after its result was stored, but for being superseded and chosen",
    "what was said of a series after its last result was stored (a broken transfer, a word that it is complete)",
    "of series that no result was made from, or that have other instances now, how they were completed: they \
     carry the doubt incomplete_transfer until a sender or a word completes them",
    "when identities were corrected before, and in what (the identities themselves are those of the files)",
    "when other attributes were corrected that no result was stored after, and of how many instances (the \
     attributes themselves are those of the files)",
    "of instances that version 0.1 stored, whether their files are what was received",
    "of results of version 0.1: attempts, the time of their request to the millisecond, and of earlier \
     revisions the set of instances (their revision is 0)",
];

impl Store {
    /// Makes a new catalog from the blobs of a data directory that no service uses, and sets the
    /// former one aside. Unless `replace`, only if that one is missing, empty or can't be opened.
    ///
    /// # Errors
    /// See [`OpenError`].
    pub async fn rebuild(config: &config::Storage, replace: bool) -> Result<Rebuilt, OpenError> {
        let root = config.data_dir.clone();
        let unusable = |cause: Box<dyn std::error::Error + Send + Sync>| OpenError::Unusable {
            path: config.data_dir.clone(),
            cause,
        };
        if !root.is_dir() {
            return Err(unusable("there is no such directory".into()));
        }
        let prepared = blocking(move || Ok(prepare(&root))).await;
        let (_lock, files) = prepared.map_err(|error| unusable(error.into()))??;
        if !replace && holds_rows(&config.data_dir.join(CATALOG)).await {
            return Err(OpenError::InUse(config.data_dir.clone()));
        }
        let unfinished = config.data_dir.join(UNFINISHED);
        remove(&unfinished).map_err(|error| unusable(error.into()))?;
        let catalog = Catalog::open(&unfinished, true).await.map_err(|error| match error {
            SchemaError::Database(error) => unusable(error.into()),
            other => unusable(other.into()),
        })?;
        let aside = Aside::of(&config.data_dir);
        let recovery = Recovery { catalog: &catalog, blobs: Arc::new(files), aside: aside.clone() };
        let filled = async {
            let blobs = recovery.run().await?;
            let (series, reconstructions) = catalog.counts().await?;
            catalog.checkpoint().await?;
            Ok::<_, crate::error::Error>((blobs, series, reconstructions))
        };
        let filled = filled.await;
        catalog.close().await;
        let (blobs, series, reconstructions) =
            filled.map_err(|error| OpenError::from_rows(&config.data_dir, error))?;
        let former_catalog = exchange(&config.data_dir, &aside).map_err(|error| unusable(error.into()))?;
        Ok(Rebuilt { series, reconstructions, blobs, former_catalog, lost: LOST })
    }
}

/// Whether the catalog is one that a service could go on with.
async fn holds_rows(file: &Path) -> bool {
    if fs::metadata(file).map_or(0, |metadata| metadata.len()) == 0 {
        return false;
    }
    let Ok(catalog) = Catalog::open(file, false).await else { return false };
    let empty = catalog.is_empty().await.unwrap_or(true);
    catalog.close().await;
    !empty
}

/// Sets the former catalog aside and gives the new one its name.
fn exchange(root: &Path, aside: &Aside) -> io::Result<Option<String>> {
    let folder = format!("catalog-{}", now_ms());
    let mut former = None;
    for file in files_of(Path::new(CATALOG)) {
        let name = file.display().to_string();
        if root.join(&name).exists() {
            aside.take_as(&name, &format!("{folder}/{name}"))?;
            former = Some(folder.clone());
        }
    }
    fs::rename(root.join(UNFINISHED), root.join(CATALOG))?;
    fs::File::open(root)?.sync_all()?;
    Ok(former)
}

fn remove(file: &Path) -> io::Result<()> {
    for path in files_of(file) {
        match fs::remove_file::<PathBuf>(path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
    }
    Ok(())
}
