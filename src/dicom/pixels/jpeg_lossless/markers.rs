//! Marker segments (annex B): everything around the entropy-coded data.

use super::Fault;
use super::huffman::{Definition, Table};

/// What the scan needs of the segments before it.
pub(super) struct Header {
    /// Bits of a sample, 2 to 16.
    pub(super) precision: u8,
    pub(super) rows: u16,
    pub(super) columns: u16,
    /// Which predictor, 1 to 7.
    pub(super) selection: u8,
    /// Bits that were cut off below each sample, fewer than `precision`.
    pub(super) point_transform: u8,
    /// Samples between restart markers, a multiple of `columns`.
    pub(super) restart_interval: Option<usize>,
    pub(super) table: Table,
    /// The byte of the stream at which the entropy-coded data begin.
    pub(super) data: usize,
}

/// The frame header (section B.2.2).
struct Frame {
    precision: u8,
    rows: u16,
    columns: u16,
    component: u8,
}

/// The segments that stand before the scan.
#[derive(Default)]
struct Tables<'a> {
    huffman: [Option<Definition<'a>>; 4],
    restart_interval: u16,
}

impl Header {
    /// Reads from the start of image to the scan's header.
    pub(super) fn read(stream: &[u8]) -> Result<Self, Fault> {
        if !stream.starts_with(&[0xFF, 0xD8]) {
            return Err(Fault::NoStart);
        }
        let mut cursor = Cursor { stream, at: 2 };
        let mut tables = Tables::default();
        let mut frame = None;
        loop {
            match cursor.marker()? {
                marker @ 0xC3 => {
                    if frame.is_some() {
                        return Err(Fault::SeveralFrames);
                    }
                    frame = Some(Frame::read(cursor.segment(marker)?)?);
                }
                0xC4 => tables.define_huffman(cursor.segment(0xC4)?)?,
                0xC9..=0xCF => return Err(Fault::Arithmetic),
                0xC5..=0xC7 | 0xDE | 0xDF => return Err(Fault::Hierarchical),
                marker @ (0xC0..=0xC2 | 0xF7) => return Err(Fault::Process(marker)),
                0xDC => return Err(Fault::NumberOfLines),
                0xD9 => return Err(Fault::EndsEarly),
                0xDA => {
                    let scan = cursor.segment(0xDA)?;
                    return Self::new(&frame.ok_or(Fault::NoFrame)?, &tables, scan, cursor.at);
                }
                0xDD => match *cursor.segment(0xDD)? {
                    [high, low] => tables.restart_interval = u16::from_be_bytes([high, low]),
                    _ => return Err(Fault::SegmentLength(0xDD)),
                },
                // Quantization tables, application data and comments say nothing of the samples.
                marker @ (0xDB | 0xE0..=0xEF | 0xFE) => {
                    cursor.segment(marker)?;
                }
                marker => return Err(Fault::UnexpectedMarker(marker)),
            }
        }
    }

    /// The header of the scan (section B.2.3).
    fn new(frame: &Frame, tables: &Tables<'_>, scan: &[u8], data: usize) -> Result<Self, Fault> {
        let (component, table, selection, low) = match *scan {
            [1, component, tables, selection, _, low] => (component, tables >> 4, selection, low & 0x0F),
            [1, ..] | [] => return Err(Fault::SegmentLength(0xDA)),
            [components, ..] => return Err(Fault::Interleaved(components)),
        };
        if component != frame.component {
            return Err(Fault::OtherComponent);
        }
        if !(1..=7).contains(&selection) {
            return Err(Fault::Selection(selection));
        }
        if low >= frame.precision {
            return Err(Fault::PointTransform(low));
        }
        let definition = tables.huffman.get(usize::from(table)).copied().flatten().ok_or(Fault::NoTable)?;
        let restart_interval = match tables.restart_interval {
            0 => None,
            samples if samples % frame.columns == 0 => Some(samples.into()),
            samples => return Err(Fault::RestartInterval(samples)),
        };
        Ok(Self {
            precision: frame.precision,
            rows: frame.rows,
            columns: frame.columns,
            selection,
            point_transform: low,
            restart_interval,
            table: Table::new(definition)?,
            data,
        })
    }
}

impl Frame {
    fn read(segment: &[u8]) -> Result<Self, Fault> {
        let (precision, rows, columns, component) = match *segment {
            [precision, y1, y0, x1, x0, 1, component, _, _] => {
                (precision, u16::from_be_bytes([y1, y0]), u16::from_be_bytes([x1, x0]), component)
            }
            [_, _, _, _, _, components, ..] if components != 1 => return Err(Fault::Components(components)),
            _ => return Err(Fault::SegmentLength(0xC3)),
        };
        if !(2..=16).contains(&precision) {
            return Err(Fault::Precision(precision));
        }
        if rows == 0 {
            return Err(Fault::NumberOfLines);
        }
        if columns == 0 {
            return Err(Fault::OtherSize { columns, rows });
        }
        Ok(Self { precision, rows, columns, component })
    }
}

impl<'a> Tables<'a> {
    /// The tables of a DHT segment. They are built when the scan chooses one.
    fn define_huffman(&mut self, mut segment: &'a [u8]) -> Result<(), Fault> {
        while let Some((&place, rest)) = segment.split_first() {
            let (counts, rest) = rest.split_first_chunk::<16>().ok_or(Fault::SegmentLength(0xC4))?;
            let codes = counts.iter().map(|count| usize::from(*count)).sum();
            let (categories, rest) = rest.split_at_checked(codes).ok_or(Fault::SegmentLength(0xC4))?;
            // Tables of class 1 are for the AC coefficients of other processes.
            if place >> 4 == 0 {
                let table = self.huffman.get_mut(usize::from(place)).ok_or(Fault::BadTable)?;
                *table = Some(Definition { counts, categories });
            }
            segment = rest;
        }
        Ok(())
    }
}

/// The restart marker number `index` at byte `at`; returns the byte after it.
pub(super) fn restart(stream: &[u8], at: usize, index: usize) -> Result<usize, Fault> {
    let mut cursor = Cursor { stream, at };
    let expected = 0xD0 | (index % 8) as u8;
    match cursor.marker()? {
        found if found == expected => Ok(cursor.at),
        0xD9 => Err(Fault::EndsEarly),
        found => Err(Fault::Restart { found, expected }),
    }
}

/// The end of image at byte `at`, and nothing after it but padding: zeros, fill bytes, or any
/// single byte (of a fragment with an even length).
pub(super) fn end(stream: &[u8], at: usize) -> Result<(), Fault> {
    let mut cursor = Cursor { stream, at };
    match cursor.marker()? {
        0xD9 => {}
        0xDA => return Err(Fault::SeveralScans),
        0xDC => return Err(Fault::NumberOfLines),
        0xD0..=0xD7 => return Err(Fault::TooMuch),
        marker => return Err(Fault::UnexpectedMarker(marker)),
    }
    let rest = stream.get(cursor.at..).unwrap_or_default();
    let is_padding = rest.len() == 1 || rest.iter().all(|byte| matches!(byte, 0x00 | 0xFF));
    if is_padding { Ok(()) } else { Err(Fault::Trailing) }
}

struct Cursor<'a> {
    stream: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn byte(&mut self) -> Result<u8, Fault> {
        let byte = *self.stream.get(self.at).ok_or(Fault::EndsEarly)?;
        self.at += 1;
        Ok(byte)
    }

    /// The marker that stands next, after any number of fill bytes FF (section B.1.1.2).
    fn marker(&mut self) -> Result<u8, Fault> {
        if self.byte()? != 0xFF {
            return Err(Fault::NoMarker);
        }
        loop {
            match self.byte()? {
                0xFF => {}
                0x00 => return Err(Fault::NoMarker),
                marker => return Ok(marker),
            }
        }
    }

    /// The parameters of a segment, after its length.
    fn segment(&mut self, marker: u8) -> Result<&'a [u8], Fault> {
        let length = usize::from(u16::from_be_bytes([self.byte()?, self.byte()?]));
        let length = length.checked_sub(2).ok_or(Fault::SegmentLength(marker))?;
        let segment = self.stream.get(self.at..).and_then(|rest| rest.get(..length));
        self.at += length;
        segment.ok_or(Fault::EndsEarly)
    }
}
