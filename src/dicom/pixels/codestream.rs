//! What a compressed stream says of its own size, before it is decoded.

/// The head of a JPEG-LS or JPEG 2000 stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Codestream {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) components: u16,
    /// Bits of a sample.
    pub(super) precision: u16,
    /// Whether it says that its samples have a sign. JPEG-LS can't say so.
    pub(super) signed: bool,
    pub(super) is_jpeg_2000: bool,
}

/// Reads the head, `None` if there is none that makes sense.
pub(super) fn read(bytes: &[u8]) -> Option<Codestream> {
    match bytes {
        [0xFF, 0x4F, 0xFF, 0x51, ..] => jpeg2000(bytes.get(4..)?),
        [0xFF, 0xD8, ..] => jpeg_ls(bytes.get(2..)?),
        _ => None,
    }
}

/// The SIZ marker segment (ISO/IEC 15444-1 section A.5.1), after its marker.
fn jpeg2000(siz: &[u8]) -> Option<Codestream> {
    let number = |at: usize| Some(u32::from_be_bytes(siz.get(at..at + 4)?.try_into().ok()?));
    // A component with fewer samples than pixels would leave pixels without a value.
    let [depth, 1, 1] = *siz.get(38..41)? else { return None };
    Some(Codestream {
        width: number(4)?.checked_sub(number(12)?)?,
        height: number(8)?.checked_sub(number(16)?)?,
        components: u16::from_be_bytes(siz.get(36..38)?.try_into().ok()?),
        precision: u16::from(depth & 0x7F) + 1,
        signed: depth & 0x80 != 0,
        is_jpeg_2000: true,
    })
}

/// The frame header (ISO/IEC 14495-1 section C.2.2), after SOI.
fn jpeg_ls(mut bytes: &[u8]) -> Option<Codestream> {
    loop {
        let (&marker, rest) = bytes.strip_prefix(&[0xFF])?.split_first()?;
        match marker {
            // Fill bytes before a marker.
            0xFF => bytes = bytes.get(1..)?,
            0xF7 => {
                let number = |at: usize| Some(u16::from_be_bytes(rest.get(at..at + 2)?.try_into().ok()?));
                return Some(Codestream {
                    width: number(5)?.into(),
                    height: number(3)?.into(),
                    components: (*rest.get(7)?).into(),
                    precision: (*rest.get(2)?).into(),
                    signed: false,
                    is_jpeg_2000: false,
                });
            }
            _ => {
                let length = usize::from(u16::from_be_bytes(rest.get(..2)?.try_into().ok()?));
                bytes = rest.get(length..)?;
            }
        }
    }
}
