//! Samples from differences: the predictors and their reset (section H.1.2.1, table H.1).

use super::Fault;
use super::bits::Bits;
use super::huffman::Table;
use super::markers::{self, Header};

/// The samples of the scan, and the byte of the stream at which their data end.
pub(super) fn samples(header: &Header, stream: &[u8]) -> Result<(Vec<u16>, usize), Fault> {
    let columns = usize::from(header.columns);
    let mut samples = vec![0; usize::from(header.rows) * columns];
    let interval = header.restart_interval.unwrap_or(samples.len());
    let mut at = header.data;
    for (index, interval) in samples.chunks_mut(interval).enumerate() {
        if index > 0 {
            at = markers::restart(stream, at, index - 1)?;
        }
        let mut bits = Bits::new(stream, at);
        decode_interval(interval, header, &mut bits)?;
        at = bits.end()?;
    }
    Ok((samples, at))
}

/// Decodes the rows of a restart interval, or of the whole scan: nothing before them counts.
fn decode_interval(samples: &mut [u16], header: &Header, bits: &mut Bits<'_>) -> Result<(), Fault> {
    let columns = usize::from(header.columns);
    let depth = header.precision - header.point_transform;
    let start = 1 << (depth - 1);
    let table = &header.table;
    // a: the sample at the left, b: the one above, c: the one above at the left. Modulo 65536.
    match header.selection {
        1 => rows(samples, columns, start, table, bits, |a, _, _| a),
        2 => rows(samples, columns, start, table, bits, |_, b, _| b),
        3 => rows(samples, columns, start, table, bits, |_, _, c| c),
        4 => rows(samples, columns, start, table, bits, |a, b, c| a.wrapping_add(b).wrapping_sub(c)),
        5 => rows(samples, columns, start, table, bits, |a, b, c| a.wrapping_add(half(b, c))),
        6 => rows(samples, columns, start, table, bits, |a, b, c| b.wrapping_add(half(a, c))),
        7 => rows(samples, columns, start, table, bits, |a, b, _| a.midpoint(b)),
        other => Err(Fault::Selection(other)),
    }?;
    let mask = u16::MAX >> (16 - depth);
    // Encoders count on a sample's lowest bits alone where a difference is the shorter one modulo
    // the precision. With the linear predictors they are right whatever stands above them; the
    // others halve, and decoders differ then.
    if header.selection > 4 && samples.iter().any(|sample| *sample > mask) {
        return Err(Fault::OutOfRange);
    }
    for sample in samples {
        *sample = (*sample & mask) << header.point_transform;
    }
    Ok(())
}

/// (first − second) / 2 by an arithmetic shift.
fn half(first: u16, second: u16) -> u16 {
    ((i32::from(first) - i32::from(second)) >> 1) as u16
}

fn rows(
    samples: &mut [u16],
    columns: usize,
    start: u16,
    table: &Table,
    bits: &mut Bits<'_>,
    predict: impl Fn(u16, u16, u16) -> u16,
) -> Result<(), Fault> {
    let mut rows = samples.chunks_exact_mut(columns);
    let Some(first) = rows.next() else { return Ok(()) };
    // The first row has nothing above it: each sample is predicted from the one before.
    let mut left = start;
    for sample in &mut *first {
        left = left.wrapping_add(table.next(bits)?);
        *sample = left;
    }
    let mut above: &[u16] = first;
    for row in rows {
        let (Some((first, rest)), Some((&start, rest_above))) = (row.split_first_mut(), above.split_first())
        else {
            return Ok(());
        };
        let (mut left, mut corner) = (start.wrapping_add(table.next(bits)?), start);
        *first = left;
        for (sample, &up) in rest.iter_mut().zip(rest_above) {
            left = predict(left, up, corner).wrapping_add(table.next(bits)?);
            corner = up;
            *sample = left;
        }
        above = row;
    }
    Ok(())
}
