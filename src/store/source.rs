//! The stored instances of a series as a source for synchronous code: each is held against its row
//! as it is read.

use std::collections::BTreeMap;
use std::fmt;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::blobs::Blobs;
use super::records::InstanceRecord;
use super::verify::{interrupted, is_whole_unless, read_unless};
use crate::dicom::source::InstanceSource;
use crate::dicom::uid::SopInstanceUid;
use crate::error::Error;

/// Stored instances, to be read by synchronous code.
#[derive(Debug, Clone)]
pub struct StoredInstances {
    blobs: Arc<dyn Blobs>,
    rows: Arc<[InstanceRecord]>,
    found: Arc<Mutex<Found>>,
}

/// What reading found wrong.
#[derive(Debug, Default)]
struct Found {
    /// True: missing; false: changed.
    damaged: BTreeMap<SopInstanceUid, bool>,
    shortage: Option<Error>,
}

/// Instances whose bytes are not what was acknowledged.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LostInstances {
    /// How many are missing; the others are changed.
    pub missing: usize,
    /// All of them, in the order of their UIDs.
    pub instances: Vec<SopInstanceUid>,
}

impl LostInstances {
    /// Stable code: `blob_missing` if all are missing, `blob_damaged` otherwise.
    #[must_use]
    pub fn code(&self) -> &'static str {
        if self.missing == self.instances.len() { "blob_missing" } else { "blob_damaged" }
    }
}

impl fmt::Display for LostInstances {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let changed = self.instances.len() - self.missing;
        write!(
            f,
            "the data directory has lost stored instances: {} missing, {changed} with other bytes than were received; \
             send these instances again, then ask for the reconstruction again, and look for a failing disk",
            self.missing
        )
    }
}

impl StoredInstances {
    pub(super) fn new(blobs: Arc<dyn Blobs>, rows: Vec<InstanceRecord>) -> Self {
        Self { blobs, rows: rows.into(), found: Arc::default() }
    }

    /// The instances that were found missing or changed so far, if any.
    #[must_use]
    pub fn damage(&self) -> Option<LostInstances> {
        let found = self.found();
        if found.damaged.is_empty() {
            return None;
        }
        let missing = found.damaged.values().filter(|missing| **missing).count();
        Some(LostInstances { missing, instances: found.damaged.keys().cloned().collect() })
    }

    /// The shortage for which one could not be read, if there was one.
    pub(crate) fn shortage(&self) -> Option<Error> {
        self.found().shortage.take()
    }

    /// Reads every one, to know all that are missing or changed.
    pub(crate) fn read_all(&self) {
        for index in 0..self.len() {
            let _what_is_wrong_is_noted = self.read(index);
        }
    }

    fn found(&self) -> MutexGuard<'_, Found> {
        self.found.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl InstanceSource for StoredInstances {
    fn len(&self) -> usize {
        self.rows.len()
    }

    fn size(&self, index: usize) -> Option<u64> {
        self.rows.get(index).map(|row| row.size)
    }

    fn read(&self, index: usize) -> io::Result<Vec<u8>> {
        self.read_unless(index, &|| false)
    }

    fn read_unless(&self, index: usize, stopped: &dyn Fn() -> bool) -> io::Result<Vec<u8>> {
        let row = self.rows.get(index).ok_or(io::ErrorKind::NotFound)?;
        let uid = &row.header.sop_instance_uid;
        match self.blobs.open(&row.blob).and_then(|blob| read_unless(blob, row.size, stopped)) {
            Ok(bytes) if is_whole_unless(row, &bytes, stopped) => Ok(bytes),
            Ok(_) if stopped() => Err(interrupted()),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => Err(error),
            Ok(_) => {
                self.found().damaged.insert(uid.clone(), false);
                Err(io::Error::new(io::ErrorKind::InvalidData, "its bytes are not what was received"))
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                self.found().damaged.insert(uid.clone(), true);
                Err(error)
            }
            Err(error) => {
                let (kind, text) = (error.kind(), error.to_string());
                let error = Error::from(error);
                if error.is_shortage() {
                    self.found().shortage = Some(error);
                }
                Err(io::Error::new(kind, text))
            }
        }
    }
}
