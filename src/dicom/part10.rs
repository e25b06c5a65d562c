//! The file header that we put in front of a data set (PS3.10 section 7.1).

use super::uid::{SopClassUid, SopInstanceUid, TransferSyntaxUid};

/// Implementation Class UID (0002,0012) of this software: a UUID-derived UID (PS3.5 section B.2).
pub const IMPLEMENTATION_CLASS_UID: &str = "2.25.211091625993334772724107020324664764348";
/// Implementation Version Name (0002,0013), at most 16 characters.
pub const IMPLEMENTATION_VERSION_NAME: &str = concat!("TRIPLANAR_", env!("CARGO_PKG_VERSION"));

/// Private Information (0002,0102) before its value: OB, as long as a SHA-256.
const PRIVATE_INFORMATION: [u8; 12] = [0x02, 0, 0x02, 0x01, b'O', b'B', 0, 0, 32, 0, 0, 0];

/// Preamble, `DICM` and group 2 for a data set in `transfer_syntax`: a Part 10 file is these bytes
/// and then the data set.
#[must_use]
pub fn file_meta(
    sop_class: &SopClassUid,
    sop_instance: &SopInstanceUid,
    transfer_syntax: &TransferSyntaxUid,
) -> Vec<u8> {
    file_meta_with(sop_class, sop_instance, transfer_syntax, None)
}

/// The same, for a data set that took the place of another one of the same image.
///
/// `image_sha256` is written as Private Information (0002,0102), with our Implementation Class UID as
/// its creator: the hash of the data set that was stored first, where this one has a corrected
/// identity.
#[must_use]
pub fn file_meta_with(
    sop_class: &SopClassUid,
    sop_instance: &SopInstanceUid,
    transfer_syntax: &TransferSyntaxUid,
    image_sha256: Option<&[u8; 32]>,
) -> Vec<u8> {
    let mut group = Vec::with_capacity(320);
    // File Meta Information Version (0002,0001) is OB, whose length takes four bytes.
    group.extend_from_slice(&[0x02, 0, 0x01, 0, b'O', b'B', 0, 0, 2, 0, 0, 0, 0, 1]);
    put(&mut group, 0x0002, b"UI", sop_class.as_str());
    put(&mut group, 0x0003, b"UI", sop_instance.as_str());
    put(&mut group, 0x0010, b"UI", transfer_syntax.as_str());
    put(&mut group, 0x0012, b"UI", IMPLEMENTATION_CLASS_UID);
    put(&mut group, 0x0013, b"SH", IMPLEMENTATION_VERSION_NAME);
    if let Some(hash) = image_sha256 {
        group.extend_from_slice(&private_information());
        group.extend_from_slice(hash);
    }

    let mut file = vec![0; 128];
    file.extend_from_slice(b"DICM");
    file.extend_from_slice(&[0x02, 0, 0x00, 0, b'U', b'L', 4, 0]);
    let length = u32::try_from(group.len()).expect("a few short values");
    file.extend_from_slice(&length.to_le_bytes());
    file.extend_from_slice(&group);
    file
}

/// What [`file_meta`] wrote as `image_sha256`, from the elements of group 2 as bytes.
#[must_use]
pub fn image_sha256(group: &[u8]) -> Option<[u8; 32]> {
    let (rest, hash) = group.split_last_chunk::<32>()?;
    rest.ends_with(&private_information()).then_some(*hash)
}

/// Private Information Creator UID (0002,0100), and Private Information without its value.
fn private_information() -> Vec<u8> {
    let mut elements = Vec::with_capacity(68);
    put(&mut elements, 0x0100, b"UI", IMPLEMENTATION_CLASS_UID);
    elements.extend_from_slice(&PRIVATE_INFORMATION);
    elements
}

/// An element of group 2 with a text of at most 64 characters, padded to an even length.
fn put(group: &mut Vec<u8>, element: u16, vr: &[u8; 2], text: &str) {
    let length = u16::try_from(text.len().next_multiple_of(2)).expect("a short text");
    group.extend_from_slice(&2_u16.to_le_bytes());
    group.extend_from_slice(&element.to_le_bytes());
    group.extend_from_slice(vr);
    group.extend_from_slice(&length.to_le_bytes());
    group.extend_from_slice(text.as_bytes());
    if text.len() % 2 == 1 {
        group.push(if vr == b"UI" { 0 } else { b' ' });
    }
}
