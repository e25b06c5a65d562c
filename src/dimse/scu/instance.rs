//! What we send: Part 10 files and blobs.

use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::PathBuf;

use dicom_object::FileMetaTable;

use super::ScuError;
use super::session::Proposal;
use crate::dicom::uid::SopInstanceUid;

/// Preamble, `DICM` and the element Group Length (0002,0000), from whose end that length counts.
const BEFORE_FILE_META: u64 = 128 + 4 + 12;

/// A Part 10 instance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Instance {
    /// A file.
    File(PathBuf),
    /// The bytes of one.
    Bytes(Vec<u8>),
}

/// An instance whose file meta information was read.
#[derive(Debug)]
pub(super) struct Sendable<'a> {
    instance: &'a Instance,
    name: String,
    pub(super) proposal: Proposal,
    pub(super) sop_instance_uid: SopInstanceUid,
    data_set_offset: u64,
}

impl<'a> Sendable<'a> {
    /// Reads the file meta information of the `index`th instance.
    pub(super) fn new(index: usize, instance: &'a Instance) -> Result<Self, ScuError> {
        let name = match instance {
            Instance::File(path) => path.display().to_string(),
            Instance::Bytes(_) => format!("instance {index}"),
        };
        let unreadable = |detail: String| ScuError::Unreadable { name: name.clone(), detail };
        let mut reader = open(instance).map_err(|error| unreadable(error.to_string()))?;
        reader.seek(SeekFrom::Start(128)).map_err(|error| unreadable(error.to_string()))?;
        let meta = FileMetaTable::from_reader(&mut reader).map_err(|error| unreadable(error.to_string()))?;
        let text = |text: &str| text.trim_end_matches(['\0', ' ']).to_owned();
        let sop_instance_uid = text(&meta.media_storage_sop_instance_uid);
        let sop_instance_uid = sop_instance_uid
            .parse()
            .map_err(|error| unreadable(format!("Media Storage SOP Instance UID (0002,0003): {error}")))?;
        let proposal = Proposal {
            abstract_syntax: text(&meta.media_storage_sop_class_uid),
            transfer_syntax: text(&meta.transfer_syntax),
        };
        let data_set_offset = BEFORE_FILE_META + u64::from(meta.information_group_length);
        Ok(Self { instance, proposal, sop_instance_uid, data_set_offset, name })
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
