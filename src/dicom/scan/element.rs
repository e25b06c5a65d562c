//! The head of one data element (PS3.5 section 7.1).

use dicom_core::Tag;

use super::ScanError;
use super::input::Input;

/// How a data set's elements are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Layout {
    /// VR written out.
    pub(crate) explicit: bool,
    /// Big endian numbers.
    pub(crate) big_endian: bool,
}

impl Layout {
    /// Implicit VR little endian: of PS3.5 section A.1 and of everything inside a UN sequence.
    pub(crate) const IMPLICIT: Self = Self { explicit: false, big_endian: false };
    /// Explicit VR little endian (PS3.5 section A.2), also of every encapsulated transfer syntax.
    pub(crate) const EXPLICIT: Self = Self { explicit: true, big_endian: false };
    /// Explicit VR big endian (PS3.5 section A.3, retired).
    pub(crate) const BIG_ENDIAN: Self = Self { explicit: true, big_endian: true };

    /// A 16-bit number.
    pub(crate) fn u16(self, bytes: [u8; 2]) -> u16 {
        if self.big_endian { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) }
    }

    /// A 32-bit number.
    pub(crate) fn u32(self, bytes: [u8; 4]) -> u32 {
        if self.big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) }
    }
}

/// The length that says: until its delimiter.
const UNDEFINED: u32 = 0xFFFF_FFFF;

/// Tag, value representation and length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Head {
    pub(crate) tag: Tag,
    /// `None` where it is not written (implicit VR, items, delimiters).
    pub(crate) vr: Option<[u8; 2]>,
    /// `None` for an undefined length.
    pub(crate) length: Option<u32>,
}

/// The VRs whose length takes 16 bits (PS3.5 section 7.1.2, table 7.1-2).
const SHORT: [&[u8; 2]; 21] = [
    b"AE", b"AS", b"AT", b"CS", b"DA", b"DS", b"DT", b"FL", b"FD", b"IS", b"LO", b"LT", b"PN", b"SH", b"SL",
    b"SS", b"ST", b"TM", b"UI", b"UL", b"US",
];

/// Reads the head that stands next.
pub(crate) fn head(input: &mut impl Input, layout: Layout) -> Result<Head, ScanError> {
    let mut tag = [0; 4];
    input.fill(&mut tag)?;
    let tag = Tag(layout.u16([tag[0], tag[1]]), layout.u16([tag[2], tag[3]]));
    let mut four = [0; 4];
    input.fill(&mut four)?;
    // Items and delimiters have no VR in any transfer syntax (PS3.5 section 7.5).
    if !layout.explicit || tag.0 == 0xFFFE {
        return Ok(Head { tag, vr: None, length: defined(layout.u32(four)) });
    }
    let vr = [four[0], four[1]];
    if !vr.iter().all(u8::is_ascii_uppercase) {
        return Err(ScanError::Malformed(format!(
            "element {tag} at byte {} has no value representation where one must stand",
            input.position().saturating_sub(8)
        )));
    }
    if SHORT.contains(&&vr) {
        return Ok(Head { tag, vr: Some(vr), length: Some(layout.u16([four[2], four[3]]).into()) });
    }
    let mut length = [0; 4];
    input.fill(&mut length)?;
    Ok(Head { tag, vr: Some(vr), length: defined(layout.u32(length)) })
}

fn defined(length: u32) -> Option<u32> {
    (length != UNDEFINED).then_some(length)
}
