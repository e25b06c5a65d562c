//! File → pictures.

use image::{Rgb, RgbImage};

use super::header::{Header, Number, SCHEMA};
use super::{MAGIC, inflated, marks};
use crate::geometry::Plane;
use crate::pipeline::{Sketch, draw, slices};

/// Why a file can't be drawn from.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PicturesError {
    /// A later version wrote it.
    #[error(
        "its pictures have schema {0}, this software knows {SCHEMA}: run the version that wrote it or a later one"
    )]
    Newer(u64),
    /// It is not what any version wrote.
    #[error("its pictures can't be read: {0}")]
    Damaged(&'static str),
}

/// A file that is drawn from.
#[derive(Debug)]
pub struct Pictures<'a> {
    header: Header,
    blocks: &'a [u8],
    /// Where each brick begins among the blocks.
    bricks: Vec<usize>,
    /// Where the marks of each plane begin.
    marks: [usize; 3],
}

const CUT: PicturesError = PicturesError::Damaged("it is cut off");
const ODD: PicturesError = PicturesError::Damaged("its sizes do not fit together");

impl<'a> Pictures<'a> {
    /// Reads the header.
    ///
    /// # Errors
    /// [`PicturesError`].
    pub fn open(file: &'a [u8]) -> Result<Self, PicturesError> {
        let rest = file.strip_prefix(&MAGIC).ok_or(PicturesError::Damaged("it is none"))?;
        let (length, rest) = rest.split_first_chunk::<4>().ok_or(CUT)?;
        let (json, blocks) = rest.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or(CUT)?;
        let odd = |_| PicturesError::Damaged("its header is not valid");
        let Number { schema } = serde_json::from_slice(json).map_err(odd)?;
        if schema > SCHEMA {
            return Err(PicturesError::Newer(schema));
        }
        let header: Header = serde_json::from_slice(json).map_err(odd)?;
        let inside = (0..3).all(|axis| {
            let end = header.origin[axis].checked_add(header.size[axis]);
            end.is_some_and(|end| end <= header.shape[axis]) && header.shape[axis] <= 1 << 16
        });
        let slices = Plane::ALL.map(|plane| slices::count(header.shape, plane));
        let listed = header.marks.each_ref().map(Vec::len);
        let counts = header.counts();
        if !inside || listed != slices || counts.iter().product::<usize>() != header.bricks.len() {
            return Err(ODD);
        }
        let mut end = 0_usize;
        let mut begins = |lengths: &[usize]| {
            let mut list = Vec::with_capacity(lengths.len());
            for length in lengths {
                list.push(end);
                end = end.saturating_add(*length);
            }
            list
        };
        let bricks = begins(&header.bricks);
        let marks = header.marks.each_ref().map(|lengths| begins(lengths).first().copied().unwrap_or(0));
        if end != blocks.len() {
            return Err(CUT);
        }
        Ok(Self { header, blocks, bricks, marks })
    }

    /// The picture of a slice; `None` if there is no such slice.
    ///
    /// # Errors
    /// [`PicturesError::Damaged`].
    pub fn slice(&self, plane: Plane, index: usize) -> Result<Option<RgbImage>, PicturesError> {
        let header = &self.header;
        let lengths = &header.marks[plane.index()];
        let Some(length) = lengths.get(index) else { return Ok(None) };
        let begin = self.marks[plane.index()] + lengths[..index].iter().sum::<usize>();
        let marks = self.marks_at(begin, *length)?;
        let shades = self.shades(plane, index)?;
        let colours: Vec<Rgb<u8>> = header.colours.iter().copied().map(Rgb).collect();
        let sketch = Sketch {
            plane,
            shape: header.shape,
            step_mm: header.step_mm,
            shades: &shades,
            marks: &marks,
            pixels: header.pixels,
            colours: &colours,
        };
        Ok(Some(draw(&sketch)))
    }

    fn marks_at(&self, begin: usize, length: usize) -> Result<Vec<crate::pipeline::Mark>, PicturesError> {
        const MOST: usize = 16_000_000 * marks::BYTES;
        if length == 0 {
            return Ok(Vec::new());
        }
        let bytes = self.blocks.get(begin..begin.saturating_add(length)).ok_or(CUT)?;
        let bytes = inflated(bytes, MOST).map_err(|_| PicturesError::Damaged("marks can't be inflated"))?;
        marks::marks_of(&bytes).ok_or(ODD)
    }

    /// The slice in shades of grey, in the rows and columns of [`slices`].
    fn shades(&self, plane: Plane, index: usize) -> Result<ndarray::Array2<u8>, PicturesError> {
        let header = &self.header;
        let across = slices::axis(plane) as usize;
        let [row_axis, column_axis] = match plane {
            Plane::Axial => [1, 2],
            Plane::Sagittal => [0, 1],
            Plane::Coronal => [0, 2],
        };
        let mut shades = ndarray::Array2::<u8>::zeros((header.shape[row_axis], header.shape[column_axis]));
        let Some(depth) = index.checked_sub(header.origin[across]).filter(|at| *at < header.size[across])
        else {
            return Ok(shades);
        };
        let counts = header.counts();
        let side = |axis: usize, brick: usize| (header.size[axis] - brick * header.brick).min(header.brick);
        for row_brick in 0..counts[row_axis] {
            for column_brick in 0..counts[column_axis] {
                let mut place = [0; 3];
                place[across] = depth / header.brick;
                (place[row_axis], place[column_axis]) = (row_brick, column_brick);
                let number = (place[0] * counts[1] + place[1]) * counts[2] + place[2];
                let sides: [usize; 3] = std::array::from_fn(|axis| side(axis, place[axis]));
                let Some(brick) = self.brick(number, sides.iter().product())? else { continue };
                for row in 0..sides[row_axis] {
                    for column in 0..sides[column_axis] {
                        let mut at = [0; 3];
                        at[across] = depth % header.brick;
                        (at[row_axis], at[column_axis]) = (row, column);
                        let shade = brick[(at[0] * sides[1] + at[1]) * sides[2] + at[2]];
                        let row = header.origin[row_axis] + row_brick * header.brick + row;
                        let column = header.origin[column_axis] + column_brick * header.brick + column;
                        // As `slices::view` does: row 0 of an upright slice is the lowest.
                        let row = if row_axis == 0 { header.shape[0] - 1 - row } else { row };
                        shades[[row, column]] = shade << header.lost_bits.min(7);
                    }
                }
            }
        }
        Ok(shades)
    }

    /// The shades of a brick; `None` for a black one.
    fn brick(&self, number: usize, voxels: usize) -> Result<Option<Vec<u8>>, PicturesError> {
        let (Some(begin), Some(length)) = (self.bricks.get(number), self.header.bricks.get(number)) else {
            return Err(ODD);
        };
        if *length == 0 {
            return Ok(None);
        }
        let bytes = self.blocks.get(*begin..begin.saturating_add(*length)).ok_or(CUT)?;
        let shades =
            inflated(bytes, voxels).map_err(|_| PicturesError::Damaged("a brick can't be inflated"))?;
        if shades.len() == voxels { Ok(Some(shades)) } else { Err(ODD) }
    }
}
