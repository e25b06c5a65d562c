//! JPEG Lossless (ISO/IEC 10918-1 process 14, annex H): what PS3.5 section A.4.1 names
//! 1.2.840.10008.1.2.4.57 and .70.
//!
//! One component in one scan, Huffman coded, selection values 1 to 7, 2 to 16 bits, any point
//! transform, restart intervals of whole rows. Whatever else a stream may be is refused by name,
//! and so is a stream that is not whole: one that ends early, or holds more than its samples.
//!
//! | file | what |
//! |---|---|
//! | `markers` | the marker segments up to the scan |
//! | `huffman` | a difference from its code and its additional bits |
//! | `bits` | the bits of the entropy-coded data |
//! | `predict` | samples from differences |

mod bits;
mod huffman;
mod markers;
mod predict;

use markers::Header;

/// Why a stream has no samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum Fault {
    #[error("does not begin with a start of image")]
    NoStart,
    #[error("ends before its samples do")]
    EndsEarly,
    #[error("has no marker where one must stand")]
    NoMarker,
    #[error("has the marker FF{0:02X} where it can't be read")]
    UnexpectedMarker(u8),
    #[error("has a marker segment FF{0:02X} of a wrong length")]
    SegmentLength(u8),
    #[error("is of another JPEG process: frame header FF{0:02X} where FFC3 (lossless, Huffman) must stand")]
    Process(u8),
    #[error("is arithmetic coded")]
    Arithmetic,
    #[error("is hierarchical")]
    Hierarchical,
    #[error("leaves its number of lines to a DNL segment")]
    NumberOfLines,
    #[error("has several frame headers")]
    SeveralFrames,
    #[error("has a scan before its frame header")]
    NoFrame,
    #[error("has {0} components; one is read")]
    Components(u8),
    #[error("has {columns} x {rows} samples")]
    OtherSize { columns: u16, rows: u16 },
    #[error("has samples of {0} bits; 2 to 16 are possible")]
    Precision(u8),
    #[error("has a scan of {0} components; one is read")]
    Interleaved(u8),
    #[error("has a scan of a component that its frame does not have")]
    OtherComponent,
    #[error("has several scans")]
    SeveralScans,
    #[error("has selection value {0}; 1 to 7 are possible")]
    Selection(u8),
    #[error("has a point transform of {0} bits, no fewer than its samples have")]
    PointTransform(u8),
    #[error("has no Huffman table for its scan")]
    NoTable,
    #[error("has a Huffman table that is none")]
    BadTable,
    #[error("has bits that are no code of its Huffman table")]
    NoCode,
    #[error("has a restart interval of {0} samples, which are no whole rows")]
    RestartInterval(u16),
    #[error("has restart marker FF{found:02X} where FF{expected:02X} must stand")]
    Restart { found: u8, expected: u8 },
    #[error("holds more data than its samples need")]
    TooMuch,
    #[error("is followed by something else")]
    Trailing,
    #[error("has samples of more bits than it says")]
    OutOfRange,
}

/// The samples of a stream, row by row.
#[derive(Debug)]
pub(super) struct Decoded {
    /// Bits of a sample.
    pub(super) precision: u8,
    /// Each with its point transform undone: its lowest bits are 0 then (section A.4).
    pub(super) samples: Vec<u16>,
}

/// Decodes a stream that must have `rows` x `columns` samples. Nothing is allocated for one that
/// claims another size.
pub(super) fn decode(stream: &[u8], rows: u16, columns: u16) -> Result<Decoded, Fault> {
    let header = Header::read(stream)?;
    if (header.rows, header.columns) != (rows, columns) {
        return Err(Fault::OtherSize { columns: header.columns, rows: header.rows });
    }
    let (samples, end) = predict::samples(&header, stream)?;
    markers::end(stream, end)?;
    Ok(Decoded { precision: header.precision, samples })
}
