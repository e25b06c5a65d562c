//! `triplanar check`: holds every file of a data directory against the catalog. Changes nothing, and
//! may run beside a service: the catalog gives a reader one state of it, and a file is never changed
//! once it has its name.

use std::collections::HashSet;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::Path;

use serde::Serialize;

use super::blobs::{Aside, Files, keys_under};
use super::catalog::{CatalogReader, InstanceRow, ResultRow};
use super::open::{CATALOG, OpenError};
use super::reading::{REPORT, cloud_name};
use super::recovery::{ChoiceRecord, RECORD, ResultRecord};
use super::verify;
use super::{Damage, HashedFile, blocking, hashed};
use crate::config;
use crate::error::Result;
use crate::geometry::Plane;

/// A file that is not what it should be.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Problem {
    /// `missing`, `damaged`, `unreadable`, `no_row` or `catalog`.
    pub kind: &'static str,
    /// Its path within the data directory.
    pub path: String,
    /// Series Instance UID, where it is known.
    pub series: Option<String>,
    /// SOP Instance UID or id of the reconstruction, where it is known.
    pub of: Option<String>,
    /// In words.
    pub detail: String,
}

/// What `Store::check` found.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Checked {
    /// Whether a service was using the data directory.
    pub in_use: bool,
    /// Instances in the catalog.
    pub instances: u64,
    /// Bytes of them that were read.
    pub bytes: u64,
    /// Results in the catalog.
    pub results: u64,
    /// Files in `set-aside/`.
    pub set_aside_files: u64,
    /// Their bytes.
    pub set_aside_bytes: u64,
    /// What is not as it should be. `no_row` is none: the next start enters such a file or sets it
    /// aside.
    pub problems: Vec<Problem>,
}

impl Checked {
    /// Whether something is lost or damaged.
    #[must_use]
    pub fn is_damaged(&self) -> bool {
        self.problems.iter().any(|problem| problem.kind != "no_row")
    }
}

impl super::Store {
    /// Holds every file of a data directory against its catalog.
    ///
    /// # Errors
    /// There is no such directory, no catalog, or one that can't be read.
    pub async fn check(config: &config::Storage) -> Result<Checked, OpenError> {
        let root = config.data_dir.clone();
        let unusable = |cause: Box<dyn std::error::Error + Send + Sync>| OpenError::Unusable {
            path: config.data_dir.clone(),
            cause,
        };
        let in_use = is_in_use(&root).map_err(|error| unusable(error.into()))?;
        if fs::metadata(root.join(CATALOG)).map_or(0, |metadata| metadata.len()) == 0 {
            return Err(OpenError::CatalogLost(root));
        }
        // A service writes the log that it has.
        if !in_use && CatalogReader::has_foreign_log(&root.join(CATALOG)).await.unwrap_or(false) {
            return Err(OpenError::ForeignLog(root));
        }
        let reader = CatalogReader::open(&root.join(CATALOG)).await;
        let reader = reader.map_err(|error| unusable(error.into()))?;
        if let Ok((found, known)) = reader.schema().await
            && found > known
        {
            reader.close().await;
            return Err(OpenError::Newer { path: root, found, known });
        }
        let checked = check(&reader, &root, in_use).await;
        reader.close().await;
        checked.map_err(|error| OpenError::from_rows(&root, error))
    }
}

/// Looks whether a service holds the locks; holds none when it returns.
fn is_in_use(root: &Path) -> io::Result<bool> {
    let directory = File::open(root)?;
    match directory.try_lock_shared() {
        Err(TryLockError::WouldBlock) => Ok(true),
        // The lock goes with the handle.
        _ => Ok(false),
    }
}

async fn check(reader: &CatalogReader, root: &Path, in_use: bool) -> Result<Checked> {
    let mut checked = Checked { in_use, ..Checked::default() };
    for detail in reader.integrity().await? {
        checked.problems.push(problem("catalog", CATALOG, None, None, &detail));
    }
    let (instances, results) = (reader.instances().await?, reader.results().await?);
    checked.instances = instances.len() as u64;
    checked.results = results.len() as u64;
    let path = root.to_owned();
    let mut checked = blocking(move || {
        let known = files(&path, &instances, &results, &mut checked)?;
        orphans(&path, &known, &mut checked)?;
        let kept = Aside::of(&path).kept()?;
        (checked.set_aside_files, checked.set_aside_bytes) = (kept.files, kept.bytes);
        Ok(checked)
    })
    .await?;
    // A service that runs may have removed, or entered, what was looked at meanwhile.
    if in_use && !checked.problems.is_empty() {
        let named: HashSet<String> = reader.named().await?.into_iter().collect();
        checked.problems.retain(|problem| {
            let prefix = problem.path.rsplit_once('/').map_or("", |(prefix, _)| prefix);
            let has_row = named.contains(&problem.path) || named.contains(prefix);
            problem.kind == "catalog" || has_row != (problem.kind == "no_row")
        });
    }
    checked.problems.sort();
    Ok(checked)
}

fn problem(kind: &'static str, path: &str, series: Option<&str>, of: Option<&str>, detail: &str) -> Problem {
    let owned = |text: Option<&str>| text.map(str::to_owned);
    Problem { kind, path: path.to_owned(), series: owned(series), of: owned(of), detail: detail.to_owned() }
}

/// Every instance and result; gives the paths that rows name.
fn files(
    root: &Path,
    instances: &[InstanceRow],
    results: &[ResultRow],
    checked: &mut Checked,
) -> Result<HashSet<String>> {
    let mut known = HashSet::new();
    for row in instances {
        known.insert(row.blob.clone());
        let (series, uid) = (row.series.as_str(), row.sop_instance.as_str());
        let found = |kind, detail: &str| problem(kind, &row.blob, Some(series), Some(uid), detail);
        match fs::read(root.join(&row.blob)) {
            Ok(file) => {
                checked.bytes += file.len() as u64;
                if file.len() as u64 != row.size {
                    let detail = format!("{} bytes instead of {}", file.len(), row.size);
                    checked.problems.push(found("damaged", &detail));
                } else if !verify::is_acknowledged(&acknowledged(row), &file) {
                    checked.problems.push(found("damaged", "not the bytes that were received (SHA-256)"));
                }
            }
            Err(error) => checked.problems.push(unread(found, &error)),
        }
    }
    for row in results {
        let keys = keys_under(root, vec![root.join(&row.prefix)])?;
        for key in &keys {
            if let Some((kind, detail)) = choice(root, row, key) {
                checked.problems.push(problem(kind, key, Some(&row.series), Some(&row.id), &detail));
            }
        }
        known.extend(keys);
        for name in names(row) {
            let key = format!("{}/{name}", row.prefix);
            if let Some((kind, detail)) = result_file(root, row, &name) {
                checked.problems.push(problem(kind, &key, Some(&row.series), Some(&row.id), &detail));
            }
        }
        if let Some((kind, detail)) = record(root, row) {
            let key = format!("{}/{RECORD}", row.prefix);
            checked.problems.push(problem(kind, &key, Some(&row.series), Some(&row.id), &detail));
        }
    }
    Ok(known)
}

fn acknowledged(row: &InstanceRow) -> verify::Acknowledged<'_> {
    verify::Acknowledged {
        sop_class: &row.sop_class,
        sop_instance: &row.sop_instance,
        transfer_syntax: &row.transfer_syntax,
        size: row.size,
        data_set_sha256: row.data_set_sha256,
    }
}

/// Names of the files that a result must have: those that its row names, or, in a result of 0.1, those of
/// its kind.
fn names(row: &ResultRow) -> Vec<String> {
    match &row.seal {
        Some(seal) => seal.names().map(str::to_owned).collect(),
        None => {
            let clouds = std::iter::once(None).chain(Plane::ALL.map(Some)).map(cloud_name);
            clouds.filter(|_| row.has_cloud).chain(std::iter::once(REPORT.to_owned())).collect()
        }
    }
}

/// What is wrong with a file of a result: by the hashes of its blocks, or, in results that have none,
/// by what it says of itself.
fn result_file(root: &Path, row: &ResultRow, name: &str) -> Option<(&'static str, String)> {
    let read = hashed::open(&Files::at(root), &row.prefix, name, row.seal.as_ref());
    match read.and_then(HashedFile::whole) {
        Ok(_) if row.seal.is_some() => None,
        Ok(bytes) if name == REPORT => whole_json(&bytes).map(|detail| ("damaged", detail.to_owned())),
        Ok(bytes) => whole_ply(&bytes).map(|detail| ("damaged", detail.to_owned())),
        Err(error) => Some(wrong(&error)),
    }
}

/// What is wrong with the file of a result if it is the record of a clinical choice.
fn choice(root: &Path, row: &ResultRow, key: &str) -> Option<(&'static str, String)> {
    let name = key.rsplit_once('/')?.1;
    if !ChoiceRecord::is_name(name) {
        return None;
    }
    let read = hashed::open_untied(&Files::at(root), &row.prefix, name).and_then(HashedFile::whole);
    match read.map(|json| ChoiceRecord::from_json(&json)) {
        Ok(Some(_)) => None,
        Ok(None) => Some(("damaged", "no record of a clinical choice".to_owned())),
        Err(error) => Some(wrong(&error)),
    }
}

fn wrong(error: &io::Error) -> (&'static str, String) {
    match Damage::of(error) {
        Some(Damage::Missing(_)) => ("missing", "the file is not there".to_owned()),
        Some(damage) => ("damaged", damage.to_string()),
        None => ("unreadable", error.to_string()),
    }
}

/// What is wrong with the record beside a result; 0.1 wrote none.
fn record(root: &Path, row: &ResultRow) -> Option<(&'static str, String)> {
    let seal = row.seal.as_ref()?;
    let read = hashed::open_untied(&Files::at(root), &row.prefix, RECORD).and_then(HashedFile::whole);
    let record = match read {
        Ok(json) => ResultRecord::from_json(&json),
        Err(error) => return Some(wrong(&error)),
    };
    match record {
        None => Some(("damaged", "no record of this version or an earlier one".to_owned())),
        Some(record) if !record.is_of(&row.prefix) || record.seal().as_ref() != Some(seal) => {
            Some(("damaged", "the record of another result".to_owned()))
        }
        Some(_) => None,
    }
}

fn unread(found: impl Fn(&'static str, &str) -> Problem, error: &io::Error) -> Problem {
    match error.kind() {
        io::ErrorKind::NotFound => found("missing", "the file is not there"),
        _ => found("unreadable", &error.to_string()),
    }
}

fn orphans(root: &Path, known: &HashSet<String>, checked: &mut Checked) -> Result<()> {
    for key in keys_under(root, vec![root.join("instances"), root.join("results")])? {
        if !known.contains(&key) {
            let detail = "no row names it: the next start enters it or sets it aside";
            checked.problems.push(problem("no_row", &key, None, None, detail));
        }
    }
    Ok(())
}

fn whole_json(file: &[u8]) -> Option<&'static str> {
    serde_json::from_slice::<serde_json::Value>(file).err().map(|_| "no JSON")
}

/// A binary PLY whose vertices are as many and as long as its header says.
fn whole_ply(file: &[u8]) -> Option<&'static str> {
    const END: &[u8] = b"end_header\n";
    let Some(end) = file.windows(END.len()).position(|window| window == END) else {
        return Some("no PLY header");
    };
    let header = String::from_utf8_lossy(&file[..end]);
    let count = header.lines().find_map(|line| line.strip_prefix("element vertex ")?.trim().parse().ok());
    let size: usize = header.lines().filter_map(|line| line.strip_prefix("property ")).map(size_of).sum();
    let body = (file.len() - end - END.len()) as u64;
    (count.map(|count: u64| count * size as u64) != Some(body)).then_some("not as long as its header says")
}

/// Bytes of a PLY property.
fn size_of(property: &str) -> usize {
    match property.split(' ').next().unwrap_or_default() {
        "char" | "uchar" | "int8" | "uint8" => 1,
        "short" | "ushort" | "int16" | "uint16" => 2,
        "double" | "float64" => 8,
        _ => 4,
    }
}
