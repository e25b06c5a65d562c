//! A cloud or a mesh as it was read.

use serde::Serialize;

use crate::geometry::{Frame, Vec3, norm, sub};

/// Points, and the triangles between them if it is a mesh.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Shape {
    /// mm, in LPS once [`Shape::into_lps`] was called.
    pub points: Vec<Vec3>,
    /// One for each point, as in the file (any length), in the frame of the points.
    pub normals: Option<Vec<Vec3>>,
    /// Other scalars of the points by name, one for each point.
    pub properties: Vec<(String, Vec<f32>)>,
    /// Indices into `points`; empty for a cloud.
    pub triangles: Vec<[u32; 3]>,
}

/// Whether a [`Shape`] has triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Points alone.
    Cloud,
    /// Points and triangles.
    Mesh,
}

/// Coordinates from here on are no head's, mm: they would overflow when squared.
const MAX_COORDINATE: f64 = 1e7;

impl Shape {
    /// A cloud of these points.
    #[must_use]
    pub fn cloud(points: Vec<Vec3>) -> Self {
        Self { points, ..Self::default() }
    }

    /// Cloud or mesh.
    #[must_use]
    pub fn kind(&self) -> Kind {
        if self.triangles.is_empty() { Kind::Cloud } else { Kind::Mesh }
    }

    /// The other scalar of that name.
    #[must_use]
    pub fn property(&self, name: &str) -> Option<&[f32]> {
        self.properties.iter().find(|(known, _)| known == name).map(|(_, values)| values.as_slice())
    }

    /// The same in LPS, given that it is in `frame`. Triangles keep their orientation: both frames
    /// are right-handed.
    #[must_use]
    pub fn into_lps(mut self, frame: Frame) -> Self {
        if frame == Frame::Ras {
            let turned = |[x, y, z]: Vec3| [-x, -y, z];
            self.points.iter_mut().for_each(|p| *p = turned(*p));
            self.normals.iter_mut().flatten().for_each(|n| *n = turned(*n));
        }
        self
    }

    /// The diagonal of the box around the points, mm; 0 without any.
    #[must_use]
    pub fn extent_mm(&self) -> f64 {
        let Some(&first) = self.points.first() else { return 0.0 };
        let (mut low, mut high) = (first, first);
        for p in &self.points {
            for a in 0..3 {
                low[a] = low[a].min(p[a]);
                high[a] = high[a].max(p[a]);
            }
        }
        norm(sub(high, low))
    }

    /// Drops points whose coordinates are not numbers or beyond 10 km, and triangles that need
    /// them; returns how many points went.
    pub fn drop_unusable(&mut self) -> usize {
        let is_usable = |p: &Vec3| p.iter().all(|c| c.abs() < MAX_COORDINATE);
        let kept: Vec<bool> = self.points.iter().map(is_usable).collect();
        let dropped = kept.iter().filter(|kept| !**kept).count();
        if dropped == 0 {
            return 0;
        }
        let mut next = 0_u32;
        let renumbered: Vec<Option<u32>> = kept
            .iter()
            .map(|&kept| {
                let index = next;
                next += u32::from(kept);
                kept.then_some(index)
            })
            .collect();
        retain(&mut self.points, &kept);
        if let Some(normals) = &mut self.normals {
            retain(normals, &kept);
        }
        for (_, values) in &mut self.properties {
            retain(values, &kept);
        }
        self.triangles = std::mem::take(&mut self.triangles)
            .into_iter()
            .filter_map(|[a, b, c]| {
                let new = |index: u32| renumbered.get(index as usize).copied().flatten();
                Some([new(a)?, new(b)?, new(c)?])
            })
            .collect();
        dropped
    }
}

fn retain<T>(values: &mut Vec<T>, kept: &[bool]) {
    let mut kept = kept.iter();
    values.retain(|_| kept.next().copied().unwrap_or(false));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unusable_points_go_with_their_triangles_and_the_rest_keeps_its_meaning() {
        let mut shape = Shape {
            points: vec![[0.0; 3], [f64::NAN, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1e9, 0.0, 0.0]],
            normals: None,
            properties: vec![("planes".to_owned(), vec![0.0, 1.0, 2.0, 3.0, 4.0])],
            triangles: vec![[0, 1, 2], [0, 2, 3], [2, 3, 4]],
        };
        assert_eq!(shape.drop_unusable(), 2);
        assert_eq!(shape.points, [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        assert_eq!(shape.property("planes"), Some(&[0.0, 2.0, 3.0][..]));
        assert_eq!(shape.triangles, [[0, 1, 2]]);
    }

    #[test]
    fn ras_is_turned_by_half_a_turn_about_z() {
        let shape = Shape { normals: Some(vec![[0.0, 1.0, 0.0]]), ..Shape::cloud(vec![[1.0, 2.0, 3.0]]) };
        let lps = shape.clone().into_lps(Frame::Ras);
        assert_eq!(lps.points, [[-1.0, -2.0, 3.0]]);
        assert_eq!(lps.normals, Some(vec![[-0.0, -1.0, 0.0]]));
        assert_eq!(shape.clone().into_lps(Frame::Lps), shape);
    }
}
