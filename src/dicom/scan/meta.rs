//! What stands before the data set: preamble and file meta information (PS3.10 section 7.1).

use std::io::{Read, Seek};

use dicom_core::Tag;
use dicom_dictionary_std::{tags, uids};

use super::ScanError;
use super::element::{Around, Layout, head};
use super::input::{Input, Seekable};
use super::values::text;
use crate::dicom::uid::TransferSyntaxUid;

/// The most elements of a group 2, and bytes of one of its values, that are read.
const MAX_ELEMENTS: usize = 64;
const MAX_VALUE: u32 = 1024;

/// Where the data set begins and how it is written.
pub(super) struct Meta {
    pub(super) data_set_offset: u64,
    pub(super) transfer_syntax_uid: TransferSyntaxUid,
}

/// Reads the meta information of a Part 10 file. One without preamble, without the magic word, or
/// without any meta information (then the data set must be little endian) is taken too.
pub(super) fn read(reader: &mut (impl Read + Seek)) -> Result<Meta, ScanError> {
    let mut start = Vec::with_capacity(132);
    reader.rewind()?;
    reader.by_ref().take(132).read_to_end(&mut start)?;
    let group_at = |at: usize| start.get(at..at + 2).map(|b| u16::from_le_bytes([b[0], b[1]]));
    let meta_offset = if start.get(128..132) == Some(b"DICM") {
        132
    } else if start.starts_with(b"DICM") {
        4
    } else if group_at(0) == Some(2) {
        0
    } else if group_at(0) == Some(8) && group_at(2).is_some_and(|element| element <= 0x0018) {
        let explicit = start.get(4..6).is_some_and(|vr| vr.iter().all(u8::is_ascii_uppercase));
        let uid = if explicit { uids::EXPLICIT_VR_LITTLE_ENDIAN } else { uids::IMPLICIT_VR_LITTLE_ENDIAN };
        return Ok(Meta { data_set_offset: 0, transfer_syntax_uid: transfer_syntax(uid)? });
    } else {
        return Err(ScanError::NotDicom(
            "it has no DICM after 128 bytes and does not begin like a data set".into(),
        ));
    };
    let mut input = Seekable::new(reader, meta_offset)?;
    let mut found = None;
    for _ in 0..MAX_ELEMENTS {
        // The group's length element is wrong in real files; the group ends where another begins.
        let position = input.position();
        if input.left().is_some_and(|left| left < 8) {
            break;
        }
        let mut group = [0; 2];
        input.fill(&mut group)?;
        let begins_other = u16::from_le_bytes(group) != 2;
        let reader = input.into_inner();
        if begins_other {
            let transfer_syntax_uid =
                found.ok_or(ScanError::Missing { attribute: "TransferSyntaxUID (0002,0010)" })?;
            return Ok(Meta { data_set_offset: position, transfer_syntax_uid });
        }
        input = Seekable::new(reader, position)?;
        let head = head(&mut input, Layout::EXPLICIT, Around::default())?;
        let length =
            head.length.filter(|length| *length <= MAX_VALUE || head.tag != tags::TRANSFER_SYNTAX_UID);
        let length = length.ok_or_else(|| malformed(head.tag))?;
        if head.tag == tags::TRANSFER_SYNTAX_UID {
            let mut value = vec![0; length as usize];
            input.fill(&mut value)?;
            found = Some(transfer_syntax(&text(&value))?);
        } else {
            input.skip(length.into())?;
        }
    }
    Err(ScanError::Malformed("its file meta information does not end, or no data set follows".into()))
}

fn transfer_syntax(text: &str) -> Result<TransferSyntaxUid, ScanError> {
    text.parse().map_err(|_| ScanError::Missing { attribute: "TransferSyntaxUID (0002,0010)" })
}

fn malformed(tag: Tag) -> ScanError {
    ScanError::Malformed(format!("element {tag} of the file meta information has no usable length"))
}
