//! A point cloud with the planes it came from.

use crate::geometry::PlaneSet;

/// Points in LPS mm. The first three lists have the same length; each of the others is as long, or
/// empty where nothing is known of it (profile `paper`).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PointCloud {
    /// LPS mm.
    pub points: Vec<[f32; 3]>,
    /// The planes whose points each vertex stands for.
    pub planes: Vec<PlaneSet>,
    /// Whether no axial point lies within 1 mm of the vertex (paper, section 3).
    pub unique: Vec<bool>,
    /// Outward unit normal of the skin, LPS.
    pub normals: Vec<[f32; 3]>,
    /// Expected error along the normal, mm.
    pub errors: Vec<f32>,
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

    /// Whether each list is as long as it must be.
    #[must_use]
    pub fn is_consistent(&self) -> bool {
        let n = self.len();
        let whole_or_none = |length: usize| length == 0 || length == n;
        self.planes.len() == n
            && self.unique.len() == n
            && whole_or_none(self.normals.len())
            && whole_or_none(self.errors.len())
    }

    /// Keeps the points for which `keep` says so, in their order.
    pub fn retain(&mut self, keep: &[bool]) {
        fn retain<T>(list: &mut Vec<T>, keep: &[bool]) {
            let mut keep = keep.iter();
            list.retain(|_| keep.next().is_some_and(|&k| k));
        }
        retain(&mut self.points, keep);
        retain(&mut self.planes, keep);
        retain(&mut self.unique, keep);
        retain(&mut self.normals, keep);
        retain(&mut self.errors, keep);
    }

    /// Keeps the points whose expected error is at most `max_mm`.
    ///
    /// # Errors
    /// [`NoErrors`] for a cloud whose errors are not known; it is left as it is.
    pub fn keep_within(&mut self, max_mm: f32) -> Result<(), NoErrors> {
        if self.errors.len() != self.len() {
            return Err(NoErrors);
        }
        let keep: Vec<bool> = self.errors.iter().map(|&error| error <= max_mm).collect();
        self.retain(&keep);
        Ok(())
    }
}

/// A cloud can't be filtered by what is not known of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the cloud's points carry no expected error: those of the profile precise do")]
pub struct NoErrors;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_at_the_limit_stay_and_every_list_follows() {
        let mut cloud = PointCloud {
            points: vec![[1.0; 3], [2.0; 3], [3.0; 3]],
            planes: [1, 2, 4].map(PlaneSet::from_bits).to_vec(),
            unique: vec![true, false, true],
            normals: vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            errors: vec![0.1, 0.11, 0.05],
        };
        cloud.keep_within(0.1).expect("errors are known");
        assert_eq!(cloud.points, [[1.0; 3], [3.0; 3]]);
        assert_eq!(cloud.planes, [1, 4].map(PlaneSet::from_bits));
        assert_eq!(cloud.unique, [true, true]);
        assert_eq!(cloud.normals, [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
        assert_eq!(cloud.errors, [0.1, 0.05]);
        cloud.errors.clear();
        assert_eq!(cloud.keep_within(0.1), Err(NoErrors));
        assert_eq!(cloud.len(), 2);
    }
}
