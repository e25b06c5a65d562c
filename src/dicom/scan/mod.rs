//! The bounded scan: a walk over the structure of an instance before anything else looks at it.
//!
//! It goes through the elements one by one with a stack of its own, so that nothing in the bytes
//! decides how deep it recurses or how much it allocates: sequences nest up to
//! [`Limits::max_depth`], every length must fit into the bytes that are left, only the few small
//! attributes of [`InstanceHeader`] are read, all other values are passed over. A deflated data
//! set is inflated on the way, up to [`Limits::max_inflated_bytes`], into nothing.
//!
//! The same walk is what [`super::series::read`] gets its attributes and pixels by: there is no
//! second parser that might understand the bytes differently.

mod element;
mod header;
mod input;
mod meta;
mod pixels;
pub(crate) mod values;
mod walk;

use std::io::{Read, Seek, SeekFrom};

use self::header::Found;
use super::header::InstanceHeader;
use super::pixel_extent::PixelExtentError;
use super::transfer_syntax::{self, TransferSyntax};
use super::uid::{SeriesInstanceUid, SopClassUid, SopInstanceUid, TransferSyntaxUid};

pub(crate) use element::Layout;
pub(crate) use input::Seekable;
pub(crate) use walk::{Event, Span, Walker};

/// What a data set may be at most.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Sequences inside one another. Real ones of CT reach 5, structured reports about 10.
    pub max_depth: usize,
    /// Elements, items and fragments of the whole data set. An Enhanced CT has some 60 a frame.
    pub max_elements: u64,
    /// What a deflated data set may inflate to.
    pub max_inflated_bytes: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { max_depth: 32, max_elements: 2_000_000, max_inflated_bytes: 1 << 30 }
    }
}

/// How the bytes are to be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Encoding {
    /// A Part 10 file with preamble and file meta information (or one that lost its preamble).
    Part10,
    /// A bare data set in this transfer syntax, as C-STORE carries it.
    DataSet(TransferSyntaxUid),
}

/// What the scan found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Scan {
    /// The attributes that the catalog needs.
    pub header: InstanceHeader,
    /// The byte at which the data set begins: 0 for a bare one.
    pub data_set_offset: u64,
    /// Pixel data of another size than the matrix and the frames need. Not judged by the scan
    /// itself: it is for whoever stores images of one sample a pixel.
    pub pixel_fault: Option<PixelExtentError>,
}

/// Why the scan refuses the bytes. The service answers each with its own code.
#[derive(Debug, thiserror::Error)]
pub enum ScanError {
    /// Not DICOM at all.
    #[error("not a DICOM data set: {0}")]
    NotDicom(String),
    /// The structure is broken, or beyond a limit.
    #[error("the data set's structure is not acceptable: {0}")]
    Malformed(String),
    /// An attribute that every instance must have is missing or not valid.
    #[error("attribute {attribute} is missing or not valid")]
    Missing {
        /// Name and tag.
        attribute: &'static str,
    },
    /// Not a transfer syntax of [`transfer_syntax::SUPPORTED`].
    #[error("transfer syntax {0} can't be decoded here")]
    UnsupportedTransferSyntax(TransferSyntaxUid),
    /// Not a SOP class of [`super::sop_class::ACCEPTED`]. The scan itself accepts any.
    #[error("SOP class {0} is not accepted")]
    UnsupportedSopClass(SopClassUid),
    /// A deflated data set that inflates beyond [`Limits::max_inflated_bytes`].
    #[error("its deflated data set inflates to more than {limit_bytes} bytes")]
    InflatesTooMuch {
        /// The limit.
        limit_bytes: u64,
    },
    /// There is no memory to decode it in.
    #[error(transparent)]
    NoMemory(#[from] crate::memory::NoMemory),
    /// It was asked to stop.
    #[error("stopped")]
    Stopped,
    /// The bytes can't be read.
    #[error("the instance can't be read")]
    Io(#[from] std::io::Error),
}

/// Scans one instance from the beginning of `reader` to its end.
///
/// SOP classes are not judged: whoever stores decides which ones it takes.
///
/// # Errors
/// See [`ScanError`]; the bytes were not understood, or can't be decoded here.
pub fn scan<R: Read + Seek>(mut reader: R, encoding: &Encoding, limits: &Limits) -> Result<Scan, ScanError> {
    let (data_set_offset, syntax) = begin(&mut reader, encoding)?;
    let mut found = Found::default();
    walk_to_end(reader, data_set_offset, syntax, limits, &mut found)?;
    let pixel_fault = found.pixel_fault();
    Ok(Scan { header: found.finish(syntax.uid())?, data_set_offset, pixel_fault })
}

/// The series and the instance that refused bytes belong to, as far as they say so before the
/// place at which [`scan`] gave up.
pub fn identify<R: Read + Seek>(
    mut reader: R,
    encoding: &Encoding,
    limits: &Limits,
) -> Option<(SeriesInstanceUid, SopInstanceUid)> {
    reader.seek(SeekFrom::Start(0)).ok()?;
    let (data_set_offset, syntax) = begin(&mut reader, encoding).ok()?;
    let mut found = Found::default();
    // Whatever ends the walk: what was found before it counts.
    let _ = walk_to_end(reader, data_set_offset, syntax, limits, &mut found);
    found.identity()
}

fn walk_to_end<R: Read + Seek>(
    mut reader: R,
    data_set_offset: u64,
    syntax: &TransferSyntax,
    limits: &Limits,
    found: &mut Found,
) -> Result<(), ScanError> {
    if syntax.deflated() {
        reader.seek(SeekFrom::Start(data_set_offset))?;
        let mut input = input::Inflating::new(reader, limits.max_inflated_bytes);
        header::collect(&mut Walker::new(&mut input, syntax.layout(), limits), found)
    } else {
        let mut input = Seekable::new(reader, data_set_offset)?;
        header::collect(&mut Walker::new(&mut input, syntax.layout(), limits), found)
    }
}

/// Where the data set begins, and in which of our transfer syntaxes it is.
pub(crate) fn begin<R: Read + Seek>(
    reader: &mut R,
    encoding: &Encoding,
) -> Result<(u64, &'static TransferSyntax), ScanError> {
    let (offset, uid) = match encoding {
        Encoding::DataSet(uid) => (0, uid.clone()),
        Encoding::Part10 => {
            let meta = meta::read(reader)?;
            (meta.data_set_offset, meta.transfer_syntax_uid)
        }
    };
    let syntax = transfer_syntax::find(&uid).ok_or(ScanError::UnsupportedTransferSyntax(uid))?;
    Ok((offset, syntax))
}
