//! The file header that we put in front of a data set (PS3.10 section 7.1).

use sha2::{Digest as _, Sha256};

use super::uid::{SopClassUid, SopInstanceUid, TransferSyntaxUid};

/// Implementation Class UID (0002,0012) of this software: a UUID-derived UID (PS3.5 section B.2).
pub const IMPLEMENTATION_CLASS_UID: &str = "2.25.211091625993334772724107020324664764348";
/// Implementation Version Name (0002,0013), at most 16 characters.
pub const IMPLEMENTATION_VERSION_NAME: &str = concat!("TRIPLANAR_", env!("CARGO_PKG_VERSION"));

/// Private Information (0002,0102) before its value: OB, as long as two SHA-256.
const PRIVATE_INFORMATION: [u8; 12] = [0x02, 0, 0x02, 0x01, b'O', b'B', 0, 0, 64, 0, 0, 0];

/// What a stored file says of its own content, so that a change of it is noticed although nothing else
/// tells what it was.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Content {
    /// SHA-256 of the data set.
    pub data_set_sha256: [u8; 32],
    /// Of a data set with a corrected identity, the hash of the data set that was stored first.
    pub image_sha256: Option<[u8; 32]>,
}

/// Preamble, `DICM` and group 2 for a data set in `transfer_syntax`: a Part 10 file is these bytes
/// and then the data set.
#[must_use]
pub fn file_meta(
    sop_class: &SopClassUid,
    sop_instance: &SopInstanceUid,
    transfer_syntax: &TransferSyntaxUid,
) -> Vec<u8> {
    with_header(group(sop_class, sop_instance, transfer_syntax))
}

/// The same, with a seal over itself and the content: it is as long for any content.
///
/// As Private Information (0002,0102), with our Implementation Class UID as its creator: the SHA-256 of
/// the elements before it, of `data_set_sha256` and of `image_sha256`, and then `image_sha256`, which is
/// zeros where there is none.
#[must_use]
pub fn sealed_file_meta(
    sop_class: &SopClassUid,
    sop_instance: &SopInstanceUid,
    transfer_syntax: &TransferSyntaxUid,
    content: &Content,
) -> Vec<u8> {
    let mut group = group(sop_class, sop_instance, transfer_syntax);
    let seal = seal(&group, content);
    group.extend_from_slice(&private_information());
    group.extend_from_slice(&seal);
    group.extend_from_slice(&content.image_sha256.unwrap_or_default());
    with_header(group)
}

/// Whether the elements of group 2, as bytes, and the data set are those that [`sealed_file_meta`] was
/// made for; `None` if it did not make them.
#[must_use]
pub fn is_as_sealed(group: &[u8], data_set_sha256: [u8; 32]) -> Option<bool> {
    let (elements, sealed, image_sha256) = sealed(group)?;
    Some(sealed == seal(elements, &Content { data_set_sha256, image_sha256 }))
}

/// What [`sealed_file_meta`] wrote as `image_sha256`, from the elements of group 2 as bytes.
#[must_use]
pub fn image_sha256(group: &[u8]) -> Option<[u8; 32]> {
    sealed(group)?.2
}

/// A SHA-256.
type Hash = [u8; 32];

/// The elements before the seal, the seal, and the hash of the image.
fn sealed(group: &[u8]) -> Option<(&[u8], Hash, Option<Hash>)> {
    let (rest, image) = group.split_last_chunk::<32>()?;
    let (rest, seal) = rest.split_last_chunk::<32>()?;
    let elements = rest.strip_suffix(private_information().as_slice())?;
    Some((elements, *seal, (*image != [0; 32]).then_some(*image)))
}

fn seal(elements: &[u8], content: &Content) -> [u8; 32] {
    let mut hash = Sha256::new_with_prefix(elements);
    hash.update(content.data_set_sha256);
    hash.update(content.image_sha256.unwrap_or_default());
    hash.finalize().into()
}

/// The elements of group 2 after their length.
fn group(
    sop_class: &SopClassUid,
    sop_instance: &SopInstanceUid,
    transfer_syntax: &TransferSyntaxUid,
) -> Vec<u8> {
    let mut group = Vec::with_capacity(384);
    // File Meta Information Version (0002,0001) is OB, whose length takes four bytes.
    group.extend_from_slice(&[0x02, 0, 0x01, 0, b'O', b'B', 0, 0, 2, 0, 0, 0, 0, 1]);
    put(&mut group, 0x0002, b"UI", sop_class.as_str());
    put(&mut group, 0x0003, b"UI", sop_instance.as_str());
    put(&mut group, 0x0010, b"UI", transfer_syntax.as_str());
    put(&mut group, 0x0012, b"UI", IMPLEMENTATION_CLASS_UID);
    put(&mut group, 0x0013, b"SH", IMPLEMENTATION_VERSION_NAME);
    group
}

/// Preamble, `DICM`, the length of the group and its elements.
fn with_header(group: Vec<u8>) -> Vec<u8> {
    let mut file = vec![0; 128];
    file.extend_from_slice(b"DICM");
    file.extend_from_slice(&[0x02, 0, 0x00, 0, b'U', b'L', 4, 0]);
    let length = u32::try_from(group.len()).expect("a few short values");
    file.extend_from_slice(&length.to_le_bytes());
    file.extend(group);
    file
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
