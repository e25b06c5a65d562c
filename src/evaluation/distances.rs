//! Distances of points to a target, in a few figures.

use serde::Serialize;

use super::target::Nearest;

/// A point farther than this is stray, mm: holder, inner anatomy.
const STRAY_MM: f64 = 2.0;

/// Distances of points, mm. Nothing is registered.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Distances {
    /// How many points were measured.
    pub points: usize,
    /// Mean distance.
    pub mean_mm: f64,
    /// Root mean square.
    pub rms_mm: f64,
    /// 95 % of the points are no farther.
    pub p95_mm: f64,
    /// 99 % of the points are no farther.
    pub p99_mm: f64,
    /// The farthest.
    pub max_mm: f64,
    /// Mean signed distance, positive outside; `None` where the target has no sides.
    pub bias_mm: Option<f64>,
    /// Share of the points farther than 2 mm, 0 to 1.
    pub stray_share: f64,
}

impl Distances {
    /// Of these answers; `None` if there are none.
    #[must_use]
    pub fn new(nearest: &[Nearest]) -> Option<Self> {
        let mut distances: Vec<f64> = nearest.iter().map(|nearest| nearest.distance).collect();
        let count = distances.len() as f64;
        let mean_mm = distances.iter().sum::<f64>() / count;
        let rms_mm = (distances.iter().map(|d| d * d).sum::<f64>() / count).sqrt();
        let stray = distances.iter().filter(|d| **d > STRAY_MM).count();
        let bias_mm =
            nearest.iter().map(|nearest| nearest.outside).sum::<Option<f64>>().map(|sum| sum / count);
        distances.sort_unstable_by(f64::total_cmp);
        Some(Self {
            points: distances.len(),
            mean_mm,
            rms_mm,
            p95_mm: percentile(&distances, 95)?,
            p99_mm: percentile(&distances, 99)?,
            max_mm: *distances.last()?,
            bias_mm,
            stray_share: stray as f64 / count,
        })
    }
}

/// The least value that at least so many per cent do not exceed.
fn percentile(sorted: &[f64], per_cent: usize) -> Option<f64> {
    let rank = (sorted.len() * per_cent).div_ceil(100);
    sorted.get(rank.saturating_sub(1)).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_figures_of_known_distances() {
        let nearest: Vec<Nearest> = (1..=200)
            .map(|n| {
                let distance = f64::from(n) / 50.0;
                Nearest { point: [0.0; 3], distance, outside: Some(-distance), index: 0 }
            })
            .collect();
        let figures = Distances::new(&nearest).unwrap();
        assert_eq!((figures.p95_mm, figures.p99_mm, figures.max_mm), (3.8, 3.96, 4.0));
        assert!((figures.mean_mm - 2.01).abs() < 1e-12);
        assert!((figures.bias_mm.unwrap() + 2.01).abs() < 1e-12);
        // Σn² = 200 · 201 · 401 / 6.
        assert!((figures.rms_mm - (200.0 * 201.0 * 401.0 / 6.0 / 200.0_f64).sqrt() / 50.0).abs() < 1e-12);
        assert_eq!(figures.stray_share, 0.5);
        assert_eq!(Distances::new(&[]), None);
    }
}
