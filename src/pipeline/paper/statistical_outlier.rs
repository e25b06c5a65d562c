//! Points that lie further from their neighbours than most (paper, section 2.3; PCL
//! `StatisticalOutlierRemoval`).

use std::num::NonZero;

use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use crate::observer::Observer;
use crate::observer::stop::{Asked, unless_stopped};
use crate::pipeline::neighbours::effort::Effort;
use crate::pipeline::neighbours::forest::Forest;
use crate::pipeline::parameters::StatisticalOutlier;
use crate::pipeline::result::PipelineError;

/// Whether each point is kept: its mean distance to the nearest others does not exceed mean +
/// `deviations` · sample standard deviation of these means over all points.
///
/// Where there are fewer others than asked for, those that there are count; a point alone is kept.
///
/// # Errors
/// [`PipelineError::Cancelled`]; [`PipelineError::TooCostly`] with too many neighbours of too many
/// points.
pub fn kept(
    points: &[[f32; 3]],
    filter: &StatisticalOutlier,
    observer: &dyn Observer,
) -> Result<Vec<bool>, PipelineError> {
    if filter.neighbours == 0 || points.len() < 2 {
        return Ok(vec![true; points.len()]);
    }
    let means = mean_distances(points, filter.neighbours as usize, observer)?;
    let asked = Asked::of(observer);
    let kept = unless_stopped(|| {
        let limit = limit(asked, &means, filter.deviations);
        let kept = |(number, &mean): (usize, &f32)| {
            asked.ask_at(number);
            f64::from(mean) <= limit
        };
        means.iter().enumerate().map(kept).collect()
    })?;
    Ok(kept)
}

/// Tests of a distance for each neighbour that is found in a search tree, about.
const TESTS_A_NEIGHBOUR: u64 = 10;

/// Mean distance of every point to its `neighbours` nearest others.
fn mean_distances(
    points: &[[f32; 3]],
    neighbours: usize,
    observer: &dyn Observer,
) -> Result<Vec<f32>, PipelineError> {
    let neighbours = neighbours.min(points.len() - 1);
    let Some(with_itself) = NonZero::new(neighbours + 1) else { return Ok(vec![0.0; points.len()]) };
    let effort = Effort::of(observer, "leaf_mm and statistical_outlier.neighbours");
    // One that is found costs some ten tests on the way through the tree.
    let tests = neighbours as u64 * TESTS_A_NEIGHBOUR;
    effort.foresee(tests.saturating_mul(points.len() as u64))?;
    let forest = Forest::new(effort.asked(), points)?;
    points
        .par_iter()
        .map(|point| {
            effort.spend(tests)?;
            let nearest = forest.nearest(*point, with_itself);
            let sum: f64 = nearest.iter().skip(1).map(|squared| f64::from(squared.sqrt())).sum();
            #[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "as in PCL")]
            {
                Ok((sum / neighbours as f64) as f32)
            }
        })
        .collect()
}

#[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53 points")]
fn limit(asked: Asked<'_>, means: &[f32], deviations: f64) -> f64 {
    let count = means.len() as f64;
    let asking = || means.iter().enumerate().inspect(|(number, _)| asked.ask_at(*number));
    let sum: f64 = asking().map(|(_, &m)| f64::from(m)).sum();
    let squares: f64 = asking().map(|(_, &m)| f64::from(m * m)).sum();
    let variance = (squares - sum * sum / count) / (count - 1.0);
    sum / count + deviations * variance.max(0.0).sqrt()
}
