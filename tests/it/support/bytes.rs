//! DICOM written by hand, so that it can be as wrong as a test wants it.

/// Explicit VR little endian.
pub(crate) const EXPLICIT_LE: &str = "1.2.840.10008.1.2.1";
/// Deflated explicit VR little endian.
pub(crate) const DEFLATED: &str = "1.2.840.10008.1.2.1.99";
/// CT Image Storage.
pub(crate) const CT_IMAGE: &str = "1.2.840.10008.5.1.4.1.1.2";

/// An element with a two-byte length.
pub(crate) fn short(group: u16, element: u16, vr: &str, value: &[u8]) -> Vec<u8> {
    let padded = value.len() + value.len() % 2;
    let mut bytes = tag(group, element);
    bytes.extend(vr.as_bytes());
    bytes.extend(u16::try_from(padded).expect("a short value").to_le_bytes());
    bytes.extend(value);
    bytes.resize(bytes.len() + padded - value.len(), if vr == "UI" { 0 } else { b' ' });
    bytes
}

/// The head of an element with a four-byte length, whatever follows.
pub(crate) fn long_head(group: u16, element: u16, vr: &str, length: u32) -> Vec<u8> {
    let mut bytes = tag(group, element);
    bytes.extend(vr.as_bytes());
    bytes.extend([0, 0]);
    bytes.extend(length.to_le_bytes());
    bytes
}

/// The head of an item or of a delimiter.
pub(crate) fn item_head(element: u16, length: u32) -> Vec<u8> {
    let mut bytes = tag(0xFFFE, element);
    bytes.extend(length.to_le_bytes());
    bytes
}

fn tag(group: u16, element: u16) -> Vec<u8> {
    [group.to_le_bytes(), element.to_le_bytes()].concat()
}

/// The attributes that every instance must have, up to group 0020.
pub(crate) fn identity(sop_instance_uid: &str, series_instance_uid: &str) -> Vec<u8> {
    [
        short(0x0008, 0x0016, "UI", CT_IMAGE.as_bytes()),
        short(0x0008, 0x0018, "UI", sop_instance_uid.as_bytes()),
        short(0x0008, 0x0060, "CS", b"CT"),
        short(0x0020, 0x000D, "UI", b"2.25.1"),
        short(0x0020, 0x000E, "UI", series_instance_uid.as_bytes()),
    ]
    .concat()
}

/// A Part 10 file around a data set.
pub(crate) fn part10(transfer_syntax: &str, sop_instance_uid: &str, data_set: &[u8]) -> Vec<u8> {
    let mut version = long_head(0x0002, 0x0001, "OB", 2);
    version.extend([0, 1]);
    let meta = [
        version,
        short(0x0002, 0x0002, "UI", CT_IMAGE.as_bytes()),
        short(0x0002, 0x0003, "UI", sop_instance_uid.as_bytes()),
        short(0x0002, 0x0010, "UI", transfer_syntax.as_bytes()),
        short(0x0002, 0x0012, "UI", b"2.25.2"),
    ]
    .concat();
    let length = u32::try_from(meta.len()).expect("a short header").to_le_bytes();
    [vec![0; 128], b"DICM".to_vec(), short(0x0002, 0x0000, "UL", &length), meta, data_set.to_vec()].concat()
}
