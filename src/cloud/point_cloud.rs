//! A point cloud with the planes it came from.

use crate::geometry::PlaneSet;

/// Points in LPS mm; the three lists have the same length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PointCloud {
    /// LPS mm.
    pub points: Vec<[f32; 3]>,
    /// The planes whose points each vertex stands for.
    pub planes: Vec<PlaneSet>,
    /// Whether no axial point lies within 1 mm of the vertex (paper, section 3).
    pub unique: Vec<bool>,
}

impl PointCloud {
    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}
