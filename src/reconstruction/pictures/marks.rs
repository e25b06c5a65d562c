//! The marks of one slice as bytes: rows, columns, kinds, one list after the other.

use crate::pipeline::Mark;

/// Of a mark that follows the rows' axis.
const ALONG_ROWS: u8 = 0x80;

/// Bytes of a mark.
pub(super) const BYTES: usize = 9;

pub(super) fn bytes_of(marks: &[Mark]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(marks.len() * BYTES);
    marks.iter().for_each(|mark| bytes.extend(mark.row.to_le_bytes()));
    marks.iter().for_each(|mark| bytes.extend(mark.column.to_le_bytes()));
    bytes.extend(marks.iter().map(|mark| mark.kind | if mark.along_rows { ALONG_ROWS } else { 0 }));
    bytes
}

/// `None` if they are none of ours.
pub(super) fn marks_of(bytes: &[u8]) -> Option<Vec<Mark>> {
    let count = bytes.len() / BYTES;
    if count * BYTES != bytes.len() {
        return None;
    }
    let (rows, rest) = bytes.split_at(4 * count);
    let (columns, kinds) = rest.split_at(4 * count);
    let number = |four: &[u8]| four.try_into().map(f32::from_le_bytes).ok();
    let places = rows.chunks_exact(4).zip(columns.chunks_exact(4)).zip(kinds);
    places
        .map(|((row, column), kind)| {
            let (kind, along_rows) = (kind & !ALONG_ROWS, kind & ALONG_ROWS != 0);
            Some(Mark { row: number(row)?, column: number(column)?, along_rows, kind })
        })
        .collect()
}
