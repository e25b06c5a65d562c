//! The head of one data element (PS3.5 section 7.1).

use dicom_core::Tag;
use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_dictionary_std::StandardDataDictionary;

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
    /// How this element is written: as its surroundings, but for an odd one.
    pub(crate) layout: Layout,
    /// It is written otherwise than its surroundings.
    pub(crate) is_odd: bool,
}

/// What stands around a head, as far as it decides how the head may be written.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Around {
    /// Bytes up to the end of what is open, where that is known.
    pub(crate) open: Option<u64>,
    /// The same, or up to the end of the file.
    pub(crate) room: Option<u64>,
    /// Inside a sequence.
    pub(crate) is_inside: bool,
    /// Inside a sequence that nobody reads.
    pub(crate) is_passage: bool,
}

/// The VRs whose length takes 16 bits (PS3.5 section 7.1.2, table 7.1-2).
const SHORT: [&[u8; 2]; 21] = [
    b"AE", b"AS", b"AT", b"CS", b"DA", b"DS", b"DT", b"FL", b"FD", b"IS", b"LO", b"LT", b"PN", b"SH", b"SL",
    b"SS", b"ST", b"TM", b"UI", b"UL", b"US",
];
/// The VRs whose length takes 32 bits, after two bytes of 0 (table 7.1-1).
const LONG: [&[u8; 2]; 13] =
    [b"OB", b"OD", b"OF", b"OL", b"OV", b"OW", b"SQ", b"SV", b"UC", b"UN", b"UR", b"UT", b"UV"];

/// Reads the head that stands next, and nothing beyond the room that there is.
///
/// Some writers leave out the VR of a private element in a data set with explicit VR, or write the
/// inside of a sequence with VR where it must have none (or without). Such a head is read as it
/// stands where nobody reads the value (a private element, the inside of a sequence that is passed
/// over), and inside of others if the dictionary confirms the VR.
pub(crate) fn head(input: &mut impl Input, layout: Layout, around: Around) -> Result<Head, ScanError> {
    let start = input.position();
    let fits = |bytes: u64| {
        if around.open.is_none_or(|room| bytes <= room) {
            return Ok(());
        }
        Err(ScanError::Malformed(format!("an element at byte {start} reaches beyond its sequence or item")))
    };
    fits(8)?;
    let mut tag = [0; 4];
    input.fill(&mut tag)?;
    let tag = Tag(layout.u16([tag[0], tag[1]]), layout.u16([tag[2], tag[3]]));
    let mut four = [0; 4];
    input.fill(&mut four)?;
    // Items and delimiters have no VR in any transfer syntax (PS3.5 section 7.5).
    if tag.0 == 0xFFFE {
        return Ok(Head { tag, vr: None, length: defined(layout.u32(four)), layout, is_odd: false });
    }
    let vr = [four[0], four[1]];
    let is_written = if layout.explicit {
        vr.iter().all(u8::is_ascii_uppercase)
    } else {
        around.is_inside && has_vr_all_the_same(tag, four, layout, around)
    };
    let is_odd = is_written != layout.explicit;
    let layout = Layout { explicit: is_written, ..layout };
    if !is_written {
        if is_odd && !around.is_passage && tag.0.is_multiple_of(2) {
            return Err(ScanError::Malformed(format!(
                "element {tag} at byte {start} has no value representation where one must stand"
            )));
        }
        return Ok(Head { tag, vr: None, length: defined(layout.u32(four)), layout, is_odd });
    }
    if SHORT.contains(&&vr) {
        let length = Some(layout.u16([four[2], four[3]]).into());
        return Ok(Head { tag, vr: Some(vr), length, layout, is_odd });
    }
    fits(12)?;
    let mut length = [0; 4];
    input.fill(&mut length)?;
    Ok(Head { tag, vr: Some(vr), length: defined(layout.u32(length)), layout, is_odd })
}

/// Whether the four bytes that should be a length are a VR and what follows it: the dictionary's VR
/// of that tag; or any VR, where the length would reach too far and nobody reads the value.
fn has_vr_all_the_same(tag: Tag, four: [u8; 4], layout: Layout, around: Around) -> bool {
    let vr = [four[0], four[1]];
    let is_vr = SHORT.contains(&&vr) || (LONG.contains(&&vr) && four[2..] == [0, 0]);
    let by_dictionary = || {
        let vr_of = StandardDataDictionary.by_tag(tag).and_then(|entry| entry.vr().exact());
        vr_of.is_some_and(|of| of.to_bytes() == vr)
    };
    let reaches_too_far = || around.room.is_some_and(|room| u64::from(layout.u32(four)) > room);
    is_vr && (by_dictionary() || (around.is_passage && reaches_too_far()))
}

fn defined(length: u32) -> Option<u32> {
    (length != UNDEFINED).then_some(length)
}
