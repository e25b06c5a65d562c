//! What we send: Part 10 files and blobs.

use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::PathBuf;

use super::ScuError;
use super::session::Proposal;
use crate::dicom::scan::{self, Encoding, Limits};
use crate::dicom::uid::SopInstanceUid;

/// A Part 10 instance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Instance {
    /// A file.
    File(PathBuf),
    /// The bytes of one.
    Bytes(Vec<u8>),
}

/// An instance that was looked at.
#[derive(Debug)]
pub(super) struct Sendable<'a> {
    instance: &'a Instance,
    name: String,
    pub(super) proposal: Proposal,
    pub(super) sop_instance_uid: SopInstanceUid,
    data_set_offset: u64,
}

impl<'a> Sendable<'a> {
    /// Looks through the `index`th instance.
    pub(super) fn new(index: usize, instance: &'a Instance) -> Result<Self, ScuError> {
        let name = match instance {
            Instance::File(path) => path.display().to_string(),
            Instance::Bytes(_) => format!("instance {index}"),
        };
        let unreadable = |detail: String| ScuError::Unreadable { name: name.clone(), detail };
        let reader = open(instance).map_err(|error| unreadable(error.to_string()))?;
        let scan = scan::scan(reader, &Encoding::Part10, &Limits::default())
            .map_err(|error| unreadable(error.to_string()))?;
        let proposal = Proposal {
            abstract_syntax: scan.header.sop_class_uid.into(),
            transfer_syntax: scan.header.transfer_syntax_uid.into(),
        };
        let sop_instance_uid = scan.header.sop_instance_uid;
        Ok(Self { instance, name, proposal, sop_instance_uid, data_set_offset: scan.data_set_offset })
    }

    /// A reader that stands at the data set.
    pub(super) fn data_set(&self) -> Result<Box<dyn Read + Send + 'a>, ScuError> {
        let opened = open(self.instance).and_then(|mut reader| {
            reader.seek(SeekFrom::Start(self.data_set_offset))?;
            Ok(reader)
        });
        match opened {
            Ok(reader) => Ok(Box::new(reader)),
            Err(error) => Err(self.unreadable(&error)),
        }
    }

    pub(super) fn unreadable(&self, error: &std::io::Error) -> ScuError {
        ScuError::Unreadable { name: self.name.clone(), detail: error.to_string() }
    }
}

trait ReadSeek: Read + Seek {}
impl<T: Read + Seek> ReadSeek for T {}

fn open(instance: &Instance) -> std::io::Result<Box<dyn ReadSeek + Send + '_>> {
    Ok(match instance {
        Instance::File(path) => Box::new(std::io::BufReader::new(std::fs::File::open(path)?)),
        Instance::Bytes(bytes) => Box::new(Cursor::new(bytes.as_slice())),
    })
}
