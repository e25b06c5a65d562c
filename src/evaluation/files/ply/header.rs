//! The header of a PLY file.

use crate::evaluation::files::bytes::{Endian, Number, take_line};
use crate::evaluation::files::words::shortened;
use crate::evaluation::files::{FileError, frame};
use crate::geometry::Frame;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Binary(Endian),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(Number),
    List { count: Number, item: Number },
}

#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    pub(super) frame: Option<Frame>,
}

impl Header {
    /// The header, and the bytes behind it.
    pub(super) fn read(bytes: &[u8]) -> Result<(Self, &[u8]), FileError> {
        let mut rest = bytes;
        if take_line(&mut rest).as_deref().map(str::trim) != Some("ply") {
            return Err(FileError::format("it does not begin with `ply`; it is no PLY file"));
        }
        let (mut encoding, mut elements, mut stated) = (None, Vec::<Element>::new(), None);
        loop {
            let line = take_line(&mut rest)
                .ok_or_else(|| FileError::length("the PLY header has no `end_header`"))?;
            let odd = || FileError::format(format!("the PLY header has the line {:?}", shortened(&line)));
            let mut words = line.split_ascii_whitespace();
            match words.next() {
                Some("end_header") => break,
                Some("format") => encoding = Some(words.next().and_then(encoding_of).ok_or_else(odd)?),
                Some("comment") => stated = stated.or(line.trim().strip_prefix("comment").and_then(frame)),
                Some("element") => {
                    let name = words.next().ok_or_else(odd)?.to_owned();
                    let count = words.next().and_then(|count| count.parse().ok()).ok_or_else(odd)?;
                    elements.push(Element { name, count, properties: Vec::new() });
                }
                Some("property") => {
                    let property = property(words).ok_or_else(odd)?;
                    elements.last_mut().ok_or_else(odd)?.properties.push(property);
                }
                Some("obj_info") | None => {}
                Some(_) => return Err(odd()),
            }
        }
        let encoding = encoding.ok_or_else(|| FileError::format("the PLY header has no `format`"))?;
        Ok((Self { encoding, elements, frame: stated }, rest))
    }
}

fn encoding_of(word: &str) -> Option<Encoding> {
    match word {
        "ascii" => Some(Encoding::Ascii),
        "binary_little_endian" => Some(Encoding::Binary(Endian::Little)),
        "binary_big_endian" => Some(Encoding::Binary(Endian::Big)),
        _ => None,
    }
}

fn property<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<Property> {
    let kind = match words.next()? {
        "list" => Kind::List { count: number(words.next()?)?, item: number(words.next()?)? },
        word => Kind::Scalar(number(word)?),
    };
    Some(Property { name: words.next()?.to_owned(), kind })
}

fn number(word: &str) -> Option<Number> {
    Some(match word {
        "char" | "int8" => Number::I8,
        "uchar" | "uint8" => Number::U8,
        "short" | "int16" => Number::I16,
        "ushort" | "uint16" => Number::U16,
        "int" | "int32" => Number::I32,
        "uint" | "uint32" => Number::U32,
        "float" | "float32" => Number::F32,
        "double" | "float64" => Number::F64,
        _ => return None,
    })
}
