//! A place where the skin crosses a grid line, measured.

use crate::geometry::{PlaneSet, Vec3};

/// A measured point of the skin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Crossing {
    /// LPS mm.
    pub(crate) place: Vec3,
    /// Outward unit normal.
    pub(crate) normal: Vec3,
    /// The planes that it lies in and that cut the skin steeply there.
    pub(crate) planes: PlaneSet,
    /// The axis of its line.
    pub(crate) axis: u8,
    /// Whether it was seen, or interpolated between two slices.
    pub(crate) between: bool,
    /// How many standard deviations of the edge there are from one voxel of the line to the next:
    /// the fewer, the better the line resolves the edge. Between slices: how far the contour moves
    /// from one to the next, in gaps.
    pub(crate) coarseness: f64,
    /// Expected error along the normal, mm, from the edge alone.
    pub(crate) error: f64,
    /// How far along the normal the crossing would move if the levels were those usual in the scan, mm.
    pub(crate) level: f64,
}
