//! A point of the skin, as a cloud holds it.

use crate::geometry::{PlaneSet, Vec3};
use crate::pipeline::precise::border::crossing::Crossing;

/// A measured point of the skin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkinPoint {
    /// LPS mm.
    pub place: [f32; 3],
    /// Outward unit normal of the surface that its neighbours within 2 mm make, LPS.
    pub normal: [f32; 3],
    /// Expected error along the normal, mm.
    pub error: f32,
    /// The planes whose points it stands for.
    pub planes: PlaneSet,
}

impl SkinPoint {
    pub(crate) fn of(crossing: &Crossing, normal: Vec3, error: f64, planes: PlaneSet) -> Self {
        let single = |v: Vec3| v.map(|v| v as f32);
        Self { place: single(crossing.place), normal: single(normal), error: error as f32, planes }
    }
}
