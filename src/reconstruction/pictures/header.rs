//! The header of the file.

use serde::{Deserialize, Serialize};

/// The schema that is written.
pub(super) const SCHEMA: u64 = 1;

/// What is looked at first.
#[derive(Debug, Deserialize)]
pub(super) struct Number {
    pub(super) schema: u64,
}

/// Schema 1. Sizes are along z, y, x.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Header {
    pub(super) schema: u64,
    /// Voxels of the volume.
    pub(super) shape: [usize; 3],
    /// mm of one step.
    pub(super) step_mm: [f64; 3],
    /// HU that are black and white.
    pub(super) window: [f32; 2],
    /// Lowest bits of grey that were left out.
    pub(super) lost_bits: u8,
    /// The part of the volume that is not black: first voxel and voxels.
    pub(super) origin: [usize; 3],
    pub(super) size: [usize; 3],
    /// Voxels along the side of a brick.
    pub(super) brick: usize,
    /// Length of each brick, in the order of z, y, x; 0 where all of it is black.
    pub(super) bricks: Vec<usize>,
    /// Whether marks are pixels of slices (`paper`) or crossings of the patient's border with grid
    /// lines (`precise`).
    pub(super) pixels: bool,
    /// Colour of each kind of mark.
    pub(super) colours: Vec<[u8; 3]>,
    /// Length of the marks of each slice: axial, sagittal, coronal.
    pub(super) marks: [Vec<usize>; 3],
}

impl Header {
    /// Numbers of bricks.
    pub(super) fn counts(&self) -> [usize; 3] {
        self.size.map(|voxels| voxels.div_ceil(self.brick.max(1)))
    }
}
