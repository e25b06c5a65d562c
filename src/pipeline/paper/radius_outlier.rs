//! Points in sparse places (paper, section 2.3; PCL `RadiusOutlierRemoval`).

use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use crate::observer::Observer;
use crate::pipeline::neighbours::cells::{Cells, squared_distance};
use crate::pipeline::neighbours::effort::{Effort, MOST_TESTS};
use crate::pipeline::parameters::RadiusOutlier;
use crate::pipeline::result::PipelineError;

/// What looking for the cells around a place costs, in tests of a distance: two bisections for each
/// of nine rows.
const BISECTIONS: u64 = 18;

/// Whether each point is kept: at least `min_neighbours` others lie within `radius_mm`, inclusive.
///
/// # Errors
/// [`PipelineError::Cancelled`]; [`PipelineError::TooCostly`] where too many points lie within the
/// radius of each other.
pub fn kept(
    points: &[[f32; 3]],
    filter: &RadiusOutlier,
    observer: &dyn Observer,
) -> Result<Vec<bool>, PipelineError> {
    if filter.min_neighbours == 0 {
        return Ok(vec![true; points.len()]);
    }
    let effort = Effort::of(observer, "leaf_mm, radius_outlier.radius_mm and .min_neighbours");
    let with_itself = filter.min_neighbours as usize + 1;
    let squared_radius = f64::from(filter.radius_mm) * f64::from(filter.radius_mm);
    // A hair wider than the radius: rounding must not push a point at exactly the radius out of
    // the cells that are searched.
    let cells = Cells::new(effort.asked(), points, f64::from(filter.radius_mm) * (1.0 + 1e-6))?;
    // Before the first distance is tested, where even the fewest tests would be too many.
    if points.len() as u64 * with_itself as u64 > MOST_TESTS {
        let at_least = |&point: &[f32; 3]| -> Result<u64, PipelineError> {
            effort.spend(BISECTIONS)?;
            let around: usize = cells.around(point).map(<[_]>::len).sum();
            Ok(around.min(with_itself) as u64)
        };
        effort.foresee(points.par_iter().map(at_least).try_reduce(|| 0, |a, b| Ok(a + b))?)?;
    }
    let is_near = |a, b| f64::from(squared_distance(a, b)) <= squared_radius;
    points
        .par_iter()
        .map(|&point| {
            let mut found = 0;
            for stretch in cells.around(point) {
                found += stretch.iter().filter(|&&other| is_near(point, other)).count();
                effort.spend(stretch.len() as u64)?;
                if found >= with_itself {
                    return Ok(true);
                }
            }
            Ok(false)
        })
        .collect()
}
