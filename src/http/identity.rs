//! What an instance calls itself in its file meta information (PS3.10 section 7.1), so that
//! an answer can name one that was refused, and the index of a medium is not taken for one.

use crate::dicom::uid::{SopClassUid, SopInstanceUid};

/// Where the file meta information begins, after preamble and prefix.
const BEGIN: usize = 132;

/// Media Storage Directory Storage: DICOMDIR, the index of a medium (PS3.10 section 8.6).
const MEDIA_DIRECTORY: &str = "1.2.840.10008.1.3.10";

/// The UIDs of an instance, as far as they can be read.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(in crate::http) struct Identity {
    /// Media Storage SOP Class UID (0002,0002).
    pub(in crate::http) sop_class_uid: Option<SopClassUid>,
    /// Media Storage SOP Instance UID (0002,0003).
    pub(in crate::http) sop_instance_uid: Option<SopInstanceUid>,
}

impl Identity {
    /// Reads the first bytes of a Part 10 file: elements of group 2, explicit VR little endian.
    pub(in crate::http) fn of(head: &[u8]) -> Self {
        let mut identity = Self::default();
        if head.get(128..BEGIN) != Some(b"DICM") {
            return identity;
        }
        let mut rest = head.get(BEGIN..).unwrap_or(&[]);
        while let Some((element, value, after)) = element(rest) {
            let text = || std::str::from_utf8(value).ok();
            match element {
                0x0002 => identity.sop_class_uid = text().and_then(|uid| uid.parse().ok()),
                0x0003 => identity.sop_instance_uid = text().and_then(|uid| uid.parse().ok()),
                _ => {}
            }
            rest = after;
        }
        identity
    }

    /// Whether this is no instance but the index of a medium.
    pub(in crate::http) fn is_media_directory(&self) -> bool {
        self.sop_class_uid.as_ref().is_some_and(|class| class.as_str() == MEDIA_DIRECTORY)
    }
}

/// The next element of group 2: its number, its value, and what follows.
fn element(bytes: &[u8]) -> Option<(u16, &[u8], &[u8])> {
    let (&[2, 0, e0, e1, v0, v1, l0, l1], rest) = bytes.split_first_chunk::<8>()? else { return None };
    let long_form = matches!(&[v0, v1], b"OB" | b"OW" | b"UN" | b"SQ" | b"UT" | b"OF");
    let (length, rest) = if long_form {
        let (length, rest) = rest.split_first_chunk::<4>()?;
        (usize::try_from(u32::from_le_bytes(*length)).ok()?, rest)
    } else {
        (usize::from(u16::from_le_bytes([l0, l1])), rest)
    };
    let (value, after) = rest.split_at_checked(length)?;
    Some((u16::from_le_bytes([e0, e1]), value, after))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_uids_are_read_and_nonsense_is_not() {
        let mut head = vec![0; 128];
        head.extend_from_slice(b"DICM");
        head.extend_from_slice(b"\x02\x00\x00\x00UL\x04\x00\x00\x00\x00\x00");
        head.extend_from_slice(b"\x02\x00\x01\x00OB\x00\x00\x02\x00\x00\x00\x00\x01");
        head.extend_from_slice(b"\x02\x00\x02\x00UI\x04\x001.2\0");
        head.extend_from_slice(b"\x02\x00\x03\x00UI\x06\x001.2.34");
        head.extend_from_slice(b"\x08\x00\x16\x00UI\x04\x009.9\0");
        let identity = Identity::of(&head);
        assert_eq!(identity.sop_class_uid, Some("1.2".parse().unwrap()));
        assert_eq!(identity.sop_instance_uid, Some("1.2.34".parse().unwrap()));
        for end in 0..head.len() {
            let _does_not_panic = Identity::of(&head[..end]);
        }
        assert_eq!(Identity::of(&[2; 500]), Identity::default());
    }
}
