//! Points that the axial cloud alone does not have (paper, section 3.2).

use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use super::cells::{Cells, squared_distance};

/// Whether each point has no axial point nearer than `distance_mm`; one at exactly that distance
/// does not count.
#[must_use]
pub fn unique(points: &[[f32; 3]], axial: &[[f32; 3]], distance_mm: f32) -> Vec<bool> {
    if distance_mm <= 0.0 {
        return vec![true; points.len()];
    }
    let squared = distance_mm * distance_mm;
    let cells = Cells::new(axial, f64::from(distance_mm) * (1.0 + 1e-6));
    let is_near = |a, b| squared_distance(a, b) < squared;
    points
        .par_iter()
        .map(|&point| !cells.around(point).flatten().any(|&other| is_near(point, other)))
        .collect()
}
