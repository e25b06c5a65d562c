//! Numbers from bytes, never beyond their end.

/// Order of the bytes of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Endian {
    Little,
    Big,
}

/// How a number is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Number {
    /// Bytes of one.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Takes one off the front of `rest`; `None` at its end.
    pub(super) fn take(self, rest: &mut &[u8], endian: Endian) -> Option<f64> {
        macro_rules! take {
            ($kind:ty) => {{
                let (bytes, after) = rest.split_first_chunk()?;
                *rest = after;
                f64::from(match endian {
                    Endian::Little => <$kind>::from_le_bytes(*bytes),
                    Endian::Big => <$kind>::from_be_bytes(*bytes),
                })
            }};
        }
        Some(match self {
            Self::I8 => take!(i8),
            Self::U8 => take!(u8),
            Self::I16 => take!(i16),
            Self::U16 => take!(u16),
            Self::I32 => take!(i32),
            Self::U32 => take!(u32),
            Self::F32 => take!(f32),
            Self::F64 => take!(f64),
        })
    }
}

/// One line without its end (LF or CR LF), as text with anything odd replaced; `None` at the end.
pub(super) fn take_line<'a>(rest: &mut &'a [u8]) -> Option<std::borrow::Cow<'a, str>> {
    if rest.is_empty() {
        return None;
    }
    let end = memchr::memchr(b'\n', rest).unwrap_or(rest.len());
    let (line, after) = rest.split_at(end);
    *rest = after.get(1..).unwrap_or(&[]);
    Some(String::from_utf8_lossy(line.strip_suffix(b"\r").unwrap_or(line)))
}

/// A count or an index that a number stands for: an integer from 0 to `u32::MAX`.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an integer within its range")]
pub(super) fn index(value: f64) -> Option<u32> {
    (value.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&value)).then_some(value as u32)
}
