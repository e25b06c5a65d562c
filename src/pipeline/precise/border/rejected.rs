//! A place where the border of the patient is not accepted as skin.

use crate::geometry::Vec3;
use crate::pipeline::precise::reason::StretchReason;

/// A border of the patient that was not accepted as skin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rejected {
    /// Rough place, LPS mm.
    pub(crate) place: Vec3,
    /// Outward unit normal.
    pub(crate) normal: Vec3,
    /// The axis of its line.
    pub(crate) axis: u8,
    /// The voxel in the patient, `[z, y, x]`.
    pub(crate) inner: [u16; 3],
    /// Why.
    pub(crate) reason: StretchReason,
    /// What was measured, in the reason's unit.
    pub(crate) measured: f64,
    /// The limit for it.
    pub(crate) limit: f64,
}
