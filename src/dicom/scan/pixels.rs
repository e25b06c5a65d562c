//! What the scan sees of Pixel Data (7FE0,0010): its size, and whether zeros alone follow the pixels.

use super::ScanError;
use super::input::Input;
use super::walk::Walker;
use crate::dicom::pixel_extent::{Matrix, PixelExtentError};

/// The size of Pixel Data.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) enum PixelExtent {
    /// There is none.
    #[default]
    Absent,
    /// One value, and what is wrong with its length.
    Native { fault: Option<PixelExtentError> },
    /// Items: the offset table, then fragments.
    Fragments { items: u64, filled: u64 },
}

/// The element of `length` bytes that came last. Pixels that are not described yet (elements stand
/// in the order of their tags, but for broken data sets) are not judged here.
pub(super) fn native<I: Input>(
    walker: &mut Walker<'_, I>,
    length: u64,
    matrix: Option<Matrix>,
) -> Result<PixelExtent, ScanError> {
    if length == 0 {
        return Ok(PixelExtent::Absent);
    }
    let fault = match matrix.map(|matrix| (matrix, matrix.check_native(length))) {
        Some((matrix, Ok(surplus))) if !walker.value_ends_in_zeros(surplus)? => Some(matrix.trailing(length)),
        Some((_, Err(fault))) => Some(fault),
        _ => None,
    };
    Ok(PixelExtent::Native { fault })
}

impl PixelExtent {
    pub(super) fn any(&self) -> bool {
        *self != Self::Absent
    }

    /// One more item of that length. The first is the offset table.
    pub(super) fn add_fragment(&mut self, length: u64) {
        *self = match *self {
            Self::Fragments { items, filled } => {
                Self::Fragments { items: items + 1, filled: filled + u64::from(length > 0) }
            }
            _ => Self::Fragments { items: 1, filled: 0 },
        };
    }

    /// What is wrong with the size.
    pub(super) fn fault(&self, matrix: Option<Matrix>) -> Option<PixelExtentError> {
        match self {
            Self::Absent => None,
            Self::Native { fault } => fault.clone(),
            Self::Fragments { filled, .. } => matrix?.check_fragments(*filled).err(),
        }
    }
}
