//! Whether the blob of an instance is what was acknowledged.

use std::io::{self, Read};

use sha2::{Digest as _, Sha256};

use super::records::InstanceRecord;
use crate::dicom::part10::{self, file_meta};
use crate::dicom::uid::{SopClassUid, SopInstanceUid, TransferSyntaxUid};

/// Where the elements of group 2 begin, after their length.
const GROUP: usize = 144;
/// Implementation Class UID (0002,0012): begins what tells the software.
const SOFTWARE: &[u8] = b"\x02\0\x12\0UI";

/// What the file of an instance must be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Acknowledged<'a> {
    pub(super) sop_class: &'a SopClassUid,
    pub(super) sop_instance: &'a SopInstanceUid,
    pub(super) transfer_syntax: &'a TransferSyntaxUid,
    /// Bytes of the file.
    pub(super) size: u64,
    pub(super) data_set_sha256: [u8; 32],
}

impl<'a> Acknowledged<'a> {
    fn of(row: &'a InstanceRecord) -> Self {
        let header = &row.header;
        Self {
            sop_class: &header.sop_class_uid,
            sop_instance: &header.sop_instance_uid,
            transfer_syntax: &header.transfer_syntax_uid,
            size: row.size,
            data_set_sha256: row.data_set_sha256,
        }
    }
}

/// SHA-256 of the data set of a Part 10 file that we wrote; `None` if it has not our header.
pub(super) fn fingerprint(file: &[u8]) -> Option<[u8; 32]> {
    fingerprint_unless(file, &|| false)
}

/// Bytes that are hashed in some 10 ms.
const PIECE: usize = 4 << 20;

fn fingerprint_unless(file: &[u8], stopped: &dyn Fn() -> bool) -> Option<[u8; 32]> {
    let mut hash = Sha256::new();
    for piece in data_set(file)?.chunks(PIECE) {
        if stopped() {
            return None;
        }
        hash.update(piece);
    }
    Some(hash.finalize().into())
}

/// Whether header and data set, with that fingerprint, are what we wrote; `None` where the header does not
/// tell: that of release 0.1.
pub(super) fn is_as_sealed(file: &[u8], fingerprint: [u8; 32]) -> Option<bool> {
    part10::is_as_sealed(file.get(GROUP..data_set_offset(file)?)?, fingerprint)
}

/// Hash of the data set that was stored first, where the file has a corrected one.
pub(super) fn image_sha256(file: &[u8]) -> Option<[u8; 32]> {
    part10::image_sha256(file.get(GROUP..data_set_offset(file)?)?)
}

/// The data set of a Part 10 file that we wrote.
fn data_set(file: &[u8]) -> Option<&[u8]> {
    file.get(data_set_offset(file)?..)
}

/// Longest header of ours, bytes: one with three UIDs and what tells the software has some 400.
const LONGEST_HEADER: usize = 1 << 12;
/// What is held of a file that is read to be hashed.
const HELD: usize = 1 << 16;

/// The header of a Part 10 file that we wrote, up to its data set, which is read next; `None` if it has
/// none of ours.
///
/// # Errors
/// Those of reading it.
pub(super) fn header_of(file: &mut impl Read) -> io::Result<Option<Vec<u8>>> {
    let mut header = Vec::new();
    file.by_ref().take(GROUP as u64).read_to_end(&mut header)?;
    let Some(end) = data_set_offset(&header).filter(|end| *end <= LONGEST_HEADER) else { return Ok(None) };
    file.by_ref().take((end - GROUP) as u64).read_to_end(&mut header)?;
    Ok((header.len() == end).then_some(header))
}

/// Whether a file is the one that the row tells of: it is read piece by piece.
///
/// # Errors
/// Those of reading it.
pub(super) fn is_whole(row: &InstanceRecord, mut file: impl Read) -> io::Result<bool> {
    let what = Acknowledged::of(row);
    let Some(header) = header_of(&mut file)?.filter(|header| names(&what, header)) else { return Ok(false) };
    let (mut size, mut hash, mut piece) = (header.len() as u64, Sha256::new(), vec![0; HELD]);
    loop {
        match file.read(&mut piece) {
            Ok(0) => {
                return Ok(size == what.size && <[u8; 32]>::from(hash.finalize()) == what.data_set_sha256);
            }
            Ok(read) => {
                size += read as u64;
                hash.update(&piece[..read]);
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

/// The same of a file that is there; false too if it is `stopped` before that is known.
pub(super) fn is_whole_unless(row: &InstanceRecord, file: &[u8], stopped: &dyn Fn() -> bool) -> bool {
    is_acknowledged_unless(&Acknowledged::of(row), file, stopped)
}

/// Whether the file is what was acknowledged.
pub(super) fn is_acknowledged(what: &Acknowledged<'_>, file: &[u8]) -> bool {
    is_acknowledged_unless(what, file, &|| false)
}

fn is_acknowledged_unless(what: &Acknowledged<'_>, file: &[u8], stopped: &dyn Fn() -> bool) -> bool {
    file.len() as u64 == what.size
        && fingerprint_unless(file, stopped) == Some(what.data_set_sha256)
        && names(what, file)
}

/// The bytes of a blob, piece by piece; [`io::ErrorKind::Interrupted`] once it is `stopped`.
pub(super) fn read_unless(mut blob: impl Read, size: u64, stopped: &dyn Fn() -> bool) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::with_capacity(usize::try_from(size).map_err(io::Error::other)?);
    while blob.by_ref().take(PIECE as u64).read_to_end(&mut bytes)? > 0 {
        if stopped() {
            return Err(interrupted());
        }
    }
    Ok(bytes)
}

pub(super) fn interrupted() -> io::Error {
    io::Error::new(io::ErrorKind::Interrupted, "stopped")
}

/// Whether the file's header names the SOP class, instance and transfer syntax. What follows them
/// there tells the software that wrote it.
fn names(what: &Acknowledged<'_>, file: &[u8]) -> bool {
    let expected = file_meta(what.sop_class, what.sop_instance, what.transfer_syntax);
    let end = expected.windows(SOFTWARE.len()).position(|window| window == SOFTWARE);
    end.is_some_and(|end| file.get(GROUP..end) == expected.get(GROUP..end))
}

/// After preamble, `DICM`, the group length (PS3.10 section 7.1) and as many bytes as it says.
fn data_set_offset(file: &[u8]) -> Option<usize> {
    let length: [u8; 4] = file.get(140..144)?.try_into().ok()?;
    (file.get(128..140)? == b"DICM\x02\0\0\0UL\x04\0").then_some(())?;
    usize::try_from(u32::from_le_bytes(length)).ok()?.checked_add(GROUP)
}
