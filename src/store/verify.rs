//! Whether the blob of an instance is what was acknowledged.

use sha2::{Digest as _, Sha256};

use super::records::InstanceRecord;
use crate::dicom::part10::file_meta;

/// Where the elements of group 2 begin, after their length.
const GROUP: usize = 144;
/// Implementation Class UID (0002,0012): begins what tells the software.
const SOFTWARE: &[u8] = b"\x02\0\x12\0UI";

/// SHA-256 of the data set of a Part 10 file that we wrote; `None` if it has not our header.
pub(super) fn fingerprint(file: &[u8]) -> Option<[u8; 32]> {
    Some(Sha256::digest(file.get(data_set_offset(file)?..)?).into())
}

/// Whether the file is the one that the row tells of.
pub(super) fn is_whole(row: &InstanceRecord, file: &[u8]) -> bool {
    file.len() as u64 == row.size && fingerprint(file) == Some(row.data_set_sha256) && names(row, file)
}

/// Whether the file's header names the row's SOP class, instance and transfer syntax. What follows
/// them there tells the software that wrote it.
fn names(row: &InstanceRecord, file: &[u8]) -> bool {
    let header = &row.header;
    let expected = file_meta(&header.sop_class_uid, &header.sop_instance_uid, &header.transfer_syntax_uid);
    let end = expected.windows(SOFTWARE.len()).position(|window| window == SOFTWARE);
    end.is_some_and(|end| file.get(GROUP..end) == expected.get(GROUP..end))
}

/// After preamble, `DICM`, the group length (PS3.10 section 7.1) and as many bytes as it says.
fn data_set_offset(file: &[u8]) -> Option<usize> {
    let length: [u8; 4] = file.get(140..144)?.try_into().ok()?;
    (file.get(128..140)? == b"DICM\x02\0\0\0UL\x04\0").then_some(())?;
    usize::try_from(u32::from_le_bytes(length)).ok()?.checked_add(GROUP)
}
