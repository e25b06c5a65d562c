//! A place where the skin crosses a grid line, roughly.

use crate::geometry::Vec3;

/// A pair of neighbouring voxels with the skin between them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Candidate {
    /// The voxel in the patient, `[z, y, x]`.
    pub(crate) inner: [u16; 3],
    /// The axis of the line.
    pub(crate) axis: u8,
    /// Whether the air lies toward the larger index.
    pub(crate) ascending: bool,
    /// Rough place, LPS mm.
    pub(crate) place: Vec3,
    /// Outward unit normal.
    pub(crate) normal: Vec3,
    /// Level of the tissue just inside, HU.
    pub(crate) tissue: f32,
    /// Level of the air just outside, HU.
    pub(crate) air: f32,
    /// By how much the tissue's level falls further in, HU.
    pub(crate) decline: f32,
}
