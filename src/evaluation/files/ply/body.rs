//! The elements of a PLY file.

use super::header::{Element, Encoding, Header, Kind};
use crate::evaluation::files::bytes::{Endian, Number, index};
use crate::evaluation::files::words::Words;
use crate::evaluation::files::{FileError, fan};

#[derive(Debug, Default)]
pub(super) struct Body {
    /// The scalars of `vertex`.
    pub(super) columns: Vec<(String, Vec<f64>)>,
    /// The faces, as fans.
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Where the numbers come from.
enum Source<'a> {
    Text(Words<'a>),
    Binary { rest: &'a [u8], endian: Endian },
}

impl Source<'_> {
    fn number(&mut self, kind: Number) -> Result<f64, FileError> {
        match self {
            Self::Text(words) => words.number(),
            Self::Binary { rest, endian } => kind
                .take(rest, *endian)
                .ok_or_else(|| FileError::length("the PLY file ends before its last element")),
        }
    }

    /// More rows can't be there, whatever a header promises.
    fn most_rows(&self, element: &Element) -> usize {
        let Self::Binary { rest, .. } = self else { return usize::MAX };
        let size = |kind| match kind {
            Kind::Scalar(number) => number.size(),
            Kind::List { count, .. } => count.size(),
        };
        rest.len() / element.properties.iter().map(|property| size(property.kind)).sum::<usize>().max(1)
    }
}

pub(super) fn read(header: &Header, rest: &[u8]) -> Result<Body, FileError> {
    let mut source = match header.encoding {
        Encoding::Ascii => Source::Text(Words::new(rest)?),
        Encoding::Binary(endian) => Source::Binary { rest, endian },
    };
    let mut body = Body::default();
    for element in &header.elements {
        if element.properties.is_empty() {
            continue;
        }
        if element.count > source.most_rows(element) {
            let promised = format!("the PLY header promises {} of {}", element.count, element.name);
            return Err(FileError::length(promised));
        }
        if element.name == "vertex" {
            body.columns = element
                .properties
                .iter()
                .filter(|property| matches!(property.kind, Kind::Scalar(_)))
                .map(|property| (property.name.clone(), Vec::new()))
                .collect();
        }
        for _ in 0..element.count {
            row(&mut source, element, &mut body)?;
        }
    }
    Ok(body)
}

fn row(source: &mut Source<'_>, element: &Element, body: &mut Body) -> Result<(), FileError> {
    let is_vertex = element.name == "vertex";
    let mut column = 0;
    for property in &element.properties {
        match property.kind {
            Kind::Scalar(kind) => {
                let value = source.number(kind)?;
                if let Some((_, values)) = body.columns.get_mut(column).filter(|_| is_vertex) {
                    values.push(value);
                    column += 1;
                }
            }
            Kind::List { count, item } => {
                let length = index(source.number(count)?)
                    .ok_or_else(|| FileError::format("a list of the PLY file has no length"))?;
                let is_corners = element.name == "face"
                    && matches!(property.name.as_str(), "vertex_indices" | "vertex_index");
                let mut corners = Vec::new();
                for _ in 0..length {
                    let value = source.number(item)?;
                    if is_corners {
                        let corner = index(value)
                            .ok_or_else(|| FileError::format("a face of the PLY file names no point"))?;
                        corners.push(corner);
                    }
                }
                body.triangles.extend(fan(&corners));
            }
        }
    }
    Ok(())
}
