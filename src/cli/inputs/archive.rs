//! The files of a zip, unpacked one by one into memory: nothing of a patient is left on disk.

use std::fs::File;
use std::io::{self, BufReader, Read as _};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use zip::ZipArchive;
use zip::result::ZipError;

use super::{Files, read_bounded};
use crate::cli::{Exit, Failed};
use crate::config::Config;

pub(super) struct Archive {
    zip: Mutex<ZipArchive<BufReader<File>>>,
    /// Index in the zip, and name, of each file in it.
    entries: Vec<(usize, String)>,
    max_instance_bytes: u64,
}

/// Whether a file begins as a zip does (PKWARE APPNOTE 4.3.7; 4.3.16 for an empty one).
pub(super) fn is_zip(path: &Path) -> io::Result<bool> {
    let mut start = Vec::new();
    File::open(path)?.take(4).read_to_end(&mut start)?;
    Ok(start == b"PK\x03\x04" || start == b"PK\x05\x06")
}

impl Archive {
    /// Opens the zip and looks at its directory.
    pub(super) fn open(path: &Path, config: &Config) -> Result<Self, Failed> {
        let refuse = |what: String| Failed::new(Exit::Input, format!("{}: {what}", path.display()));
        let unreadable = |error: ZipError| refuse(format!("the zip can't be read: {error}"));
        let file = File::open(path).map_err(|error| refuse(format!("can't be read: {error}")))?;
        let mut zip = ZipArchive::new(BufReader::new(file)).map_err(unreadable)?;
        let limit = config.http.max_archive_entries;
        if zip.len() as u64 > limit {
            return Err(refuse(format!("more than {limit} entries (setting http.max_archive_entries)")));
        }
        let (mut entries, mut unpacked) = (Vec::new(), 0_u64);
        for index in 0..zip.len() {
            let entry = zip.by_index_raw(index).map_err(unreadable)?;
            if !entry.is_file() {
                continue;
            }
            // An entry that unpacks to more than it says fails when it is read: no more is taken.
            unpacked = unpacked.saturating_add(entry.size());
            entries.push((index, String::from_utf8_lossy(entry.name_raw()).into_owned()));
        }
        let limit = config.http.max_unpacked_bytes;
        if unpacked > limit {
            return Err(refuse(format!(
                "unpacks to more than {limit} bytes (setting http.max_unpacked_bytes)"
            )));
        }
        entries.sort_by(|a, b| a.1.cmp(&b.1));
        Ok(Self { zip: Mutex::new(zip), entries, max_instance_bytes: config.intake.max_instance_bytes })
    }
}

impl Files for Archive {
    fn len(&self) -> usize {
        self.entries.len()
    }

    fn name(&self, index: usize) -> String {
        self.entries.get(index).map(|(_, name)| name.clone()).unwrap_or_default()
    }

    fn read(&self, index: usize) -> io::Result<Vec<u8>> {
        let (entry, name) = self.entries.get(index).ok_or(io::ErrorKind::NotFound)?;
        let mut zip = self.zip.lock().unwrap_or_else(PoisonError::into_inner);
        let file = zip.by_index(*entry)?;
        let limit = file.size().min(self.max_instance_bytes);
        read_bounded(file, limit, name)
    }
}
