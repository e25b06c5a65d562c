//! Blobs without a row: entered again, or set aside; never deleted, unless the transaction that
//! took their row noted them (`catalog/removed.rs`).
//!
//! | what a blob without a row is | what becomes of it |
//! |---|---|
//! | noted as removed | it is removed |
//! | an instance that is not stored | entered: it is what was sent, and its sender may count on it |
//! | an instance whose row names a blob that is gone, with the same data set | the row names it |
//! | a later data set of the image that its row tells of: a correction that came after a backup of the catalog | the row takes it |
//! | a result whose reconstruction is unknown | entered from its record, or, of 0.1, as far as its report tells |
//! | an instance whose file is not as its header says that it was received | set aside |
//! | anything else | set aside under `set-aside/`, for so many days and bytes |
//!
//! An instance that was never acknowledged because of a crash does no harm when it is entered: its
//! sender sends it again, and is told that it is there.

mod from_report;
mod rebuild;
mod record;

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::io;
use std::sync::Arc;

use serde::Serialize;

use super::blobs::{Aside, Blobs};
use super::blocking;
use super::catalog::{Catalog, Columns, Found, NewInstance};
use super::hashed::{self, Damage, HashedFile, Seal};
use super::reading::REPORT;
use super::verify::{fingerprint, image_sha256, is_as_sealed};
use crate::dicom::header::InstanceHeader;
use crate::dicom::scan::{self, Encoding, Limits};
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::{Error, Result};

pub use rebuild::Rebuilt;
pub(super) use record::RECORD;
pub(crate) use record::{ChoiceRecord, ResultRecord};

/// A blob that could not get a row, and why.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SetAside {
    /// Its path below `set-aside/`.
    pub path: String,
    /// Why.
    pub reason: String,
}

/// Instances of a series that its results were made from and that no file holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct MissingInstances {
    /// The series.
    pub series_instance_uid: String,
    /// How many instances of it are stored. 0: they may have been removed after their time.
    pub stored: u64,
    /// SOP Instance UIDs of the others.
    pub lost: Vec<String>,
}

/// What became of the blobs without a row.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Recovered {
    /// Instances that have a row again.
    pub instances: u64,
    /// How many of them release 0.1 stored: whether their files are what was received is not known.
    pub unsealed_instances: u64,
    /// Instances whose row named a blob that was gone.
    pub repaired: u64,
    /// Instances whose row told of an earlier data set of the same image: corrected identities, and other
    /// corrected attributes.
    pub corrected: u64,
    /// Results that have their row again.
    pub results: u64,
    /// Results of which only the report told: what it does not tell is lost.
    pub from_reports: Vec<String>,
    /// Files of entered results that are missing or are not what was written, with why: ask for these
    /// reconstructions again.
    pub damaged_results: Vec<String>,
    /// Instances that entered results were made from and that are not stored.
    pub missing_instances: Vec<MissingInstances>,
    /// Records of operators' clinical choices that can't be read: look which cloud is the clinical one.
    pub unread_choices: Vec<String>,
    /// The others.
    pub set_aside: Vec<SetAside>,
}

impl Recovered {
    /// How many rows name another blob now than before, or are new.
    pub(super) fn rows(&self) -> u64 {
        self.instances + self.repaired + self.corrected + self.results
    }
}

/// Where blobs without a row are looked for, and what they get.
pub(super) struct Recovery<'a> {
    pub(super) catalog: &'a Catalog,
    pub(super) blobs: Arc<dyn Blobs>,
    pub(super) aside: Aside,
}

impl Recovery<'_> {
    /// Gives every blob without a row its row, or sets it aside.
    pub(super) async fn run(&self) -> Result<Recovered> {
        let (instances, results) = self.catalog.named_blobs().await?;
        let blobs = Arc::clone(&self.blobs);
        let keys = blocking(move || Ok(blobs.keys()?)).await?;
        let (instances, results): (HashSet<_>, HashSet<_>) =
            (instances.into_iter().collect(), results.into_iter().collect());
        let mut found_instances = Vec::new();
        let mut found_results: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for key in keys {
            match key.rsplit_once('/') {
                Some((prefix, _)) if key.starts_with("results/") => {
                    if !results.contains(prefix) {
                        found_results.entry(prefix.to_owned()).or_default().push(key);
                    }
                }
                _ if instances.contains(&key) => {}
                _ => found_instances.push(key),
            }
        }
        let mut recovered = Recovered::default();
        self.instances(found_instances, &mut recovered).await?;
        if recovered.instances > 0 {
            self.catalog.restore_identity_changes().await?;
        }
        self.results(found_results, &mut recovered).await?;
        Ok(recovered)
    }

    /// The latest first: what they say of the patient becomes what the series says.
    async fn instances(&self, keys: Vec<String>, recovered: &mut Recovered) -> Result<()> {
        let mut found = Vec::new();
        for key in keys {
            let blobs = Arc::clone(&self.blobs);
            let read = move || {
                let instance = examine(&*blobs, &key).map_err(Error::internal)?;
                Ok((key, instance))
            };
            match blocking(read).await? {
                (_, Ok(instance)) => found.push(instance),
                (key, Err(reason)) => self.set_aside(key, reason, recovered).await?,
            }
        }
        found.sort_by(|a, b| {
            b.modified_ms.cmp(&a.modified_ms).then_with(|| a.instance.blob.cmp(&b.instance.blob))
        });
        for Examined { instance, modified_ms, is_sealed } in found {
            let written_ms = |blob: &str| self.blobs.modified_ms(blob).ok();
            match self.catalog.enter_found(&instance, modified_ms, written_ms).await? {
                Found::Entered => {
                    recovered.instances += 1;
                    recovered.unsealed_instances += u64::from(!is_sealed);
                }
                Found::Repaired => recovered.repaired += 1,
                Found::Corrected => recovered.corrected += 1,
                Found::Refused(reason) => self.set_aside(instance.blob, reason, recovered).await?,
            }
        }
        Ok(())
    }

    async fn results(
        &self,
        prefixes: BTreeMap<String, Vec<String>>,
        recovered: &mut Recovered,
    ) -> Result<()> {
        let mut choices = Vec::new();
        let mut made_from: BTreeMap<SeriesInstanceUid, BTreeSet<String>> = BTreeMap::new();
        // Ids are UUIDv7: the latest comes first.
        for (prefix, keys) in prefixes.into_iter().rev() {
            let found = match self.record(&prefix).await? {
                Ok(Some(record)) => {
                    let found = self.catalog.enter_result(&record, &prefix).await?;
                    if found == Found::Entered {
                        if let Some(seal) = record.seal() {
                            recovered.damaged_results.extend(self.damage(&prefix, seal).await?);
                        }
                        choices.extend(record.choices);
                        let series = record.reconstruction.get("series_uid").and_then(|uid| uid.as_str());
                        if let Some(series) = series.and_then(|uid| uid.parse().ok()) {
                            made_from.entry(series).or_default().extend(record.instances);
                        }
                    }
                    found
                }
                Ok(None) => self.found_by_report(&prefix, &keys, recovered).await?,
                Err(reason) => Found::Refused(reason),
            };
            if found == Found::Entered {
                self.choices(&prefix, &keys, &mut choices, recovered).await;
            }
            match found {
                Found::Refused(reason) => {
                    for key in keys {
                        self.set_aside(key, reason, recovered).await?;
                    }
                }
                Found::Entered | Found::Repaired | Found::Corrected => recovered.results += 1,
            }
        }
        if recovered.results > 0 {
            self.catalog.settle_results(&recovered.from_reports).await?;
            self.catalog.enter_choices(&choices).await?;
        }
        for (series, instances) in made_from {
            recovered.missing_instances.extend(self.lost(series, instances).await?);
        }
        Ok(())
    }

    /// Those of the instances that are not stored.
    async fn lost(
        &self,
        series: SeriesInstanceUid,
        mut instances: BTreeSet<String>,
    ) -> Result<Option<MissingInstances>> {
        let stored = self.catalog.instances(&series).await?;
        for instance in &stored {
            instances.remove(instance.header.sop_instance_uid.as_str());
        }
        Ok((!instances.is_empty()).then(|| MissingInstances {
            series_instance_uid: series.to_string(),
            stored: stored.len() as u64,
            lost: instances.into_iter().collect(),
        }))
    }

    /// What operators chose, as it is written beside a result.
    async fn choices(
        &self,
        prefix: &str,
        keys: &[String],
        choices: &mut Vec<Columns>,
        recovered: &mut Recovered,
    ) {
        let is_choice = |key: &&String| {
            key.strip_prefix(prefix).is_some_and(|name| ChoiceRecord::is_name(name.trim_start_matches('/')))
        };
        for key in keys.iter().filter(is_choice) {
            let name = key.trim_start_matches(prefix).trim_start_matches('/').to_owned();
            let (blobs, place) = (Arc::clone(&self.blobs), prefix.to_owned());
            let read = move || Ok(hashed::open_untied(&*blobs, &place, &name).and_then(HashedFile::whole));
            let json = blocking(read).await.ok().and_then(io::Result::ok);
            match json.as_deref().and_then(ChoiceRecord::from_json) {
                Some(record) => choices.push(record.choice),
                None => recovered.unread_choices.push(key.clone()),
            }
        }
    }

    /// The record beside a result; `None` if there is none; or why it can't be used.
    async fn record(&self, prefix: &str) -> Result<Result<Option<ResultRecord>, &'static str>> {
        let (blobs, place) = (Arc::clone(&self.blobs), prefix.to_owned());
        let read = move || Ok(hashed::open_untied(&*blobs, &place, RECORD).and_then(HashedFile::whole));
        let json = match blocking(read).await? {
            Ok(json) => json,
            Err(error) => match Damage::of(&error) {
                Some(Damage::Missing(_)) => return Ok(Ok(None)),
                Some(_) => return Ok(Err("its record is damaged")),
                None => return Err(error.into()),
            },
        };
        Ok(match ResultRecord::from_json(&json) {
            Some(record) if record.is_of(prefix) => Ok(Some(record)),
            Some(_) => Err("its record is that of another result"),
            None => Err("its record can't be read"),
        })
    }

    /// The files of a result that are missing or are not what was written, with why.
    async fn damage(&self, prefix: &str, seal: Seal) -> Result<Vec<String>> {
        let (blobs, prefix) = (Arc::clone(&self.blobs), prefix.to_owned());
        blocking(move || {
            let mut damaged = Vec::new();
            for name in seal.names() {
                let checked = hashed::open(&*blobs, &prefix, name, Some(&seal)).and_then(HashedFile::check);
                if let Err(error) = checked {
                    damaged.push(format!("{prefix}/{name}: {error}"));
                }
            }
            Ok(damaged)
        })
        .await
    }

    /// A result of a version that wrote no records.
    async fn found_by_report(
        &self,
        prefix: &str,
        keys: &[String],
        recovered: &mut Recovered,
    ) -> Result<Found> {
        let Some(report) = self.blob(format!("{prefix}/{REPORT}")).await else {
            return Ok(Found::Refused("neither a record nor a report"));
        };
        let (blobs, key) = (Arc::clone(&self.blobs), format!("{prefix}/{REPORT}"));
        let written_ms = blocking(move || Ok(blobs.modified_ms(&key)?)).await?;
        let Some(record) = from_report::record(self.catalog, prefix, &report, keys, written_ms).await? else {
            return Ok(Found::Refused("no record, and no report of a release that wrote none"));
        };
        let found = self.catalog.enter_result(&record, prefix).await?;
        if found == Found::Entered {
            recovered.from_reports.push(prefix.to_owned());
        }
        Ok(found)
    }

    async fn blob(&self, key: String) -> Option<Vec<u8>> {
        let blobs = Arc::clone(&self.blobs);
        blocking(move || Ok(blobs.read(&key)?)).await.ok()
    }

    async fn set_aside(&self, key: String, reason: &str, recovered: &mut Recovered) -> Result<()> {
        let (aside, path) = (self.aside.clone(), key.clone());
        blocking(move || Ok(aside.take(&path)?)).await?;
        recovered.set_aside.push(SetAside { path: key, reason: reason.to_owned() });
        Ok(())
    }
}

/// The blob of an instance.
struct Examined {
    instance: NewInstance,
    /// When it was written, Unix ms.
    modified_ms: i64,
    /// Whether it tells that it is what was received; release 0.1 wrote nothing that would.
    is_sealed: bool,
}

/// What the blob of an instance is; or why it is none that can be entered.
fn examine(blobs: &dyn Blobs, key: &str) -> io::Result<Result<Examined, &'static str>> {
    const UNREADABLE: &str = "no instance that can be read";
    const CHANGED: &str = "its bytes are not what was received (SHA-256): send this instance again";
    let bytes = blobs.read(key)?;
    let Some(data_set_sha256) = fingerprint(&bytes) else { return Ok(Err(UNREADABLE)) };
    let sealed = is_as_sealed(&bytes, data_set_sha256);
    if sealed == Some(false) {
        return Ok(Err(CHANGED));
    }
    let scanned = scan::scan(std::io::Cursor::new(&bytes), &Encoding::Part10, &Limits::default());
    let Ok(scan) = scanned else { return Ok(Err(UNREADABLE)) };
    let header: InstanceHeader = scan.header;
    let instance = NewInstance {
        header,
        blob: key.to_owned(),
        size: bytes.len() as u64,
        data_set_sha256,
        image_sha256: image_sha256(&bytes),
    };
    Ok(Ok(Examined { instance, modified_ms: blobs.modified_ms(key)?, is_sealed: sealed.is_some() }))
}
