//! PCD 0.6 and 0.7, the Point Cloud Library's file: ascii and binary, not compressed.

use super::bytes::{Endian, Number, take_line};
use super::words::{Words, shortened};
use super::{Contents, FileError, frame, shape_of_columns};

#[derive(Debug, Default)]
struct Header {
    fields: Vec<String>,
    sizes: Vec<String>,
    types: Vec<String>,
    counts: Vec<usize>,
    points: Option<usize>,
}

pub(super) fn read(bytes: &[u8]) -> Result<Contents, FileError> {
    let mut rest = bytes;
    let (mut header, mut stated) = (Header::default(), None);
    let data = loop {
        let line =
            take_line(&mut rest).ok_or_else(|| FileError::length("the PCD header has no line DATA"))?;
        let line = line.trim();
        if let Some(comment) = line.strip_prefix('#') {
            stated = stated.or(frame(comment));
            continue;
        }
        let odd = || FileError::format(format!("the PCD header has the line {:?}", shortened(line)));
        let (key, value) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let words = || value.split_ascii_whitespace().map(str::to_owned);
        match key {
            "FIELDS" => header.fields = words().collect(),
            "SIZE" => header.sizes = words().collect(),
            "TYPE" => header.types = words().collect(),
            "COUNT" => {
                header.counts = words().map(|n| n.parse().ok()).collect::<Option<_>>().ok_or_else(odd)?;
            }
            "POINTS" => header.points = Some(value.trim().parse().map_err(|_| odd())?),
            "DATA" => break value.trim().to_owned(),
            "VERSION" | "WIDTH" | "HEIGHT" | "VIEWPOINT" | "" => {}
            _ => return Err(odd()),
        }
    };
    let columns = header.columns()?;
    let points = header.points.ok_or_else(|| FileError::format("the PCD header has no line POINTS"))?;
    let columns = match data.as_str() {
        "ascii" => text(rest, points, columns)?,
        "binary" => binary(rest, points, columns)?,
        other => {
            return Err(FileError::format(format!(
                "PCD data {:?} are not read; make them binary with `pcl_convert_pcd_ascii_binary IN OUT 1`",
                shortened(other)
            )));
        }
    };
    Ok(Contents { shape: shape_of_columns(columns)?, frame: stated })
}

/// A name and how its numbers are stored.
type Column = (String, Number);

impl Header {
    /// A column for each number of a point; fields of several numbers get an index.
    fn columns(&self) -> Result<Vec<Column>, FileError> {
        let count = self.fields.len();
        let has_counts = !self.counts.is_empty();
        if count == 0
            || self.sizes.len() != count
            || self.types.len() != count
            || (has_counts && self.counts.len() != count)
        {
            return Err(FileError::format("FIELDS, SIZE, TYPE and COUNT of the PCD header do not match"));
        }
        let mut columns = Vec::new();
        for (index, name) in self.fields.iter().enumerate() {
            let (kind, size) = (&self.types[index], &self.sizes[index]);
            let number = number(kind, size).ok_or_else(|| {
                FileError::format(format!("PCD numbers of type {kind} and size {size} are not read"))
            })?;
            let repeats = if has_counts { self.counts[index] } else { 1 };
            if repeats > MAX_COUNT {
                return Err(FileError::format(format!(
                    "the PCD field {} has too many numbers",
                    shortened(name)
                )));
            }
            for repeat in 0..repeats {
                let name = if repeats == 1 { name.clone() } else { format!("{name}_{repeat}") };
                columns.push((name, number));
            }
        }
        Ok(columns)
    }
}

/// Numbers of one field; descriptors have some hundred.
const MAX_COUNT: usize = 4096;

fn number(kind: &str, size: &str) -> Option<Number> {
    Some(match (kind, size) {
        ("I", "1") => Number::I8,
        ("U", "1") => Number::U8,
        ("I", "2") => Number::I16,
        ("U", "2") => Number::U16,
        ("I", "4") => Number::I32,
        ("U", "4") => Number::U32,
        ("F", "4") => Number::F32,
        ("F", "8") => Number::F64,
        _ => return None,
    })
}

fn text(rest: &[u8], points: usize, columns: Vec<Column>) -> Result<Vec<(String, Vec<f64>)>, FileError> {
    let mut words = Words::new(rest)?;
    let mut values: Vec<(String, Vec<f64>)> =
        columns.into_iter().map(|(name, _)| (name, Vec::new())).collect();
    for _ in 0..if values.is_empty() { 0 } else { points } {
        for (_, values) in &mut values {
            values.push(words.number()?);
        }
    }
    Ok(values)
}

fn binary(rest: &[u8], points: usize, columns: Vec<Column>) -> Result<Vec<(String, Vec<f64>)>, FileError> {
    let size: usize = columns.iter().map(|(_, number)| number.size()).sum();
    let short = || FileError::length(format!("the PCD header promises {points} points"));
    let length = points.checked_mul(size).ok_or_else(short)?;
    // PCL's own files may be longer: it rounds the mapped length up.
    let mut rest = rest.get(..length).ok_or_else(short)?;
    let mut values: Vec<(String, Vec<f64>)> =
        columns.iter().map(|(name, _)| (name.clone(), Vec::with_capacity(length / size.max(1)))).collect();
    while !rest.is_empty() {
        for ((_, values), (_, number)) in values.iter_mut().zip(&columns) {
            values.push(number.take(&mut rest, Endian::Little).ok_or_else(short)?);
        }
    }
    Ok(values)
}
