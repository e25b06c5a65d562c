//! Points that the axial cloud alone does not have (paper, section 3.2).

use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use super::cells::{Cells, squared_distance};
use super::effort::Effort;
use crate::geometry::Plane;
use crate::observer::Observer;
use crate::pipeline::result::figures::share;
use crate::pipeline::result::{PipelineError, Reconstruction};

/// Whether each point has no axial point nearer than `distance_mm`; one at exactly that distance
/// does not count.
///
/// # Panics
/// Never: nothing stops it.
#[must_use]
pub fn unique(points: &[[f32; 3]], axial: &[[f32; 3]], distance_mm: f32) -> Vec<bool> {
    unique_within(points, axial, distance_mm, &Effort::unbounded()).expect("an effort without bound")
}

/// The same with a bounded effort.
///
/// # Errors
/// [`PipelineError::Cancelled`]; [`PipelineError::TooCostly`] where too many axial points must be
/// looked at.
pub(crate) fn unique_within(
    points: &[[f32; 3]],
    axial: &[[f32; 3]],
    distance_mm: f32,
    effort: &Effort<'_>,
) -> Result<Vec<bool>, PipelineError> {
    if distance_mm <= 0.0 {
        return Ok(vec![true; points.len()]);
    }
    let squared = distance_mm * distance_mm;
    let cells = Cells::new(effort.asked(), axial, f64::from(distance_mm) * (1.0 + 1e-6))?;
    let is_near = |a, b| squared_distance(a, b) < squared;
    points
        .par_iter()
        .map(|&point| {
            for stretch in cells.around(point) {
                let nearest = stretch.iter().position(|&other| is_near(point, other));
                effort.spend(nearest.map_or(stretch.len(), |tests| tests + 1) as u64)?;
                if nearest.is_some() {
                    return Ok(false);
                }
            }
            Ok(true)
        })
        .collect()
}

impl Reconstruction {
    /// Marks the unique points of every cloud and counts those of the result.
    ///
    /// # Errors
    /// [`PipelineError::Cancelled`], [`PipelineError::TooCostly`].
    pub(crate) fn mark_unique(
        &mut self,
        distance_mm: f32,
        observer: &dyn Observer,
    ) -> Result<(), PipelineError> {
        let effort = Effort::of(observer, "leaf_mm and unique_distance_mm");
        let mut axial = Vec::new();
        effort.asked().extend(&mut axial, &self.uniplanar[Plane::Axial.index()].points);
        for cloud in self.uniplanar.iter_mut().chain([&mut self.triplanar]) {
            cloud.unique = unique_within(&cloud.points, &axial, distance_mm, &effort)?;
        }
        self.figures.unique = self.triplanar.unique.iter().filter(|&&u| u).count() as u64;
        self.figures.unique_share = share(self.figures.unique.cast_signed(), self.figures.after_statistical);
        Ok(())
    }
}
