//! Points in sparse places (paper, section 2.3; PCL `RadiusOutlierRemoval`).

use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use super::cells::{Cells, squared_distance};
use super::parameters::RadiusOutlier;

/// Whether each point is kept: at least `min_neighbours` others lie within `radius_mm`, inclusive.
#[must_use]
pub fn kept(points: &[[f32; 3]], filter: &RadiusOutlier) -> Vec<bool> {
    if filter.min_neighbours == 0 {
        return vec![true; points.len()];
    }
    let with_itself = filter.min_neighbours as usize + 1;
    let squared_radius = f64::from(filter.radius_mm) * f64::from(filter.radius_mm);
    // A hair wider than the radius: rounding must not push a point at exactly the radius out of
    // the cells that are searched.
    let cells = Cells::new(points, f64::from(filter.radius_mm) * (1.0 + 1e-6));
    let is_near = |a, b| f64::from(squared_distance(a, b)) <= squared_radius;
    points
        .par_iter()
        .map(|&point| {
            let mut found = 0;
            cells.around(point).any(|stretch| {
                found += stretch.iter().filter(|&&other| is_near(point, other)).count();
                found >= with_itself
            })
        })
        .collect()
}
