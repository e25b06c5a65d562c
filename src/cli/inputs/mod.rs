//! The DICOM files that a command is given: those of a folder, of a zip, or one file.

mod archive;
mod folder;

use std::io::{self, Cursor};
use std::path::Path;

use super::{Exit, Failed};
use crate::config::Config;
use crate::dicom::header::InstanceHeader;
use crate::dicom::scan::{Encoding, scan};
use crate::dicom::source::InstanceSource;
use crate::error::Error;
use crate::reconstruction::UnusedFile;
use archive::Archive;
use folder::Folder;

/// Files that can be read again and again, one at a time in memory.
trait Files: Sync {
    /// Their number.
    fn len(&self) -> usize;
    /// The file's name, relative to the input.
    fn name(&self, index: usize) -> String;
    /// The whole file.
    fn read(&self, index: usize) -> io::Result<Vec<u8>>;
}

/// The files below a path, with what the bounded scan found in them.
pub(super) struct Inputs {
    files: Box<dyn Files>,
    /// Index of the file and what its header says; files that can't be used are not among them.
    pub(super) instances: Vec<(usize, InstanceHeader)>,
    /// Files that are no DICOM instance, or one that can't be used, with the reason.
    pub(super) refused: Vec<UnusedFile>,
}

/// Instances of one series among the [`Inputs`].
pub(super) struct Selected<'a> {
    pub(super) inputs: &'a Inputs,
    /// Indices of files.
    pub(super) files: Vec<usize>,
}

impl Inputs {
    /// Opens a folder (searched through), a zip, or a single file, and scans what is in it.
    pub(super) fn open(path: &Path, config: &Config) -> Result<Self, Failed> {
        let unreadable =
            |error: io::Error| Failed::new(Exit::Input, format!("{} can't be read: {error}", path.display()));
        let files: Box<dyn Files> = if path.is_dir() {
            Box::new(Folder::walk(path, config.intake.max_instance_bytes).map_err(unreadable)?)
        } else if archive::is_zip(path).map_err(unreadable)? {
            Box::new(Archive::open(path, config)?)
        } else {
            Box::new(Folder::single(path, config.intake.max_instance_bytes))
        };
        let mut inputs = Self { files, instances: Vec::new(), refused: Vec::new() };
        for index in 0..inputs.files.len() {
            inputs.scan(index, config).map_err(unreadable)?;
        }
        Ok(inputs)
    }

    fn scan(&mut self, index: usize, config: &Config) -> io::Result<()> {
        let bytes = self.files.read(index)?;
        let limits = config.read_limits().scan;
        match scan(Cursor::new(bytes), &Encoding::Part10, &limits) {
            Ok(found) => self.instances.push((index, found.header)),
            Err(error) => {
                let error = Error::from(error);
                let code = error.mapping().code.to_owned();
                self.refused.push(UnusedFile {
                    name: self.files.name(index),
                    code,
                    detail: error.to_string(),
                });
            }
        }
        Ok(())
    }

    /// Number of files looked at.
    pub(super) fn len(&self) -> usize {
        self.files.len()
    }
}

impl Selected<'_> {
    /// The files that were not used: what was refused, and the instances of other series; by name.
    pub(super) fn unused(&self) -> Vec<UnusedFile> {
        let mut unused = self.inputs.refused.clone();
        let others = self.inputs.instances.iter().filter(|(file, _)| !self.files.contains(file));
        unused.extend(others.map(|(file, header)| UnusedFile {
            name: self.inputs.files.name(*file),
            code: "other-series".to_owned(),
            detail: format!("of series {}", header.series_instance_uid),
        }));
        unused.sort_by(|a, b| a.name.cmp(&b.name));
        unused
    }
}

impl InstanceSource for Selected<'_> {
    fn len(&self) -> usize {
        self.files.len()
    }

    fn read(&self, index: usize) -> io::Result<Vec<u8>> {
        let file = self.files.get(index).ok_or(io::ErrorKind::NotFound)?;
        self.inputs.files.read(*file)
    }
}

/// Reads to the end, but no more than `limit` bytes.
fn read_bounded(reader: impl io::Read, limit: u64, name: &str) -> io::Result<Vec<u8>> {
    use io::Read as _;
    let mut bytes = Vec::new();
    reader.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(io::Error::new(
            io::ErrorKind::FileTooLarge,
            format!("{name} is larger than the limit of {limit} bytes (setting intake.max_instance_bytes)"),
        ));
    }
    Ok(bytes)
}
