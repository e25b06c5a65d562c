//! The whole pipeline, step by step.

use super::decisions::decide;
use super::lift::{lift, outside_axial_box};
use super::observer::{Observer, Stage};
use super::outcome::{Figures, PipelineError, Reconstruction};
use super::parameters::Parameters;
use super::unique::unique;
use super::voxel_grid::voxel_grid;
use super::{radius_outlier, statistical_outlier};
use crate::cloud::PointCloud;
use crate::dicom::Volume;
use crate::geometry::Plane;

/// Reconstructs the skin surface of a head from a CT volume (paper, section 2).
///
/// Runs on the rayon pool of the caller; the result is the same on any number of threads.
///
/// # Errors
/// [`PipelineError::EmptyCloud`] with everything found so far if no point is left,
/// [`PipelineError::Cancelled`] if the observer asks for it.
pub fn reconstruct(
    volume: &Volume,
    parameters: &Parameters,
    observer: &dyn Observer,
) -> Result<Reconstruction, PipelineError> {
    let decisions = decide(&volume.hu, parameters, observer)?;

    enter(observer, Stage::Downsampling)?;
    let raw = lift(&decisions, &volume.grid);
    let mut result = Reconstruction {
        triplanar: PointCloud::default(),
        uniplanar: raw.each_ref().map(|cloud| voxel_grid(cloud, parameters.leaf_mm)),
        figures: Figures {
            raw: raw.each_ref().map(count),
            outside_axial_box: outside_axial_box(&decisions, &raw),
            ..Figures::default()
        },
        slices: decisions.rows,
    };
    drop(raw);
    result.triplanar = voxel_grid(&concatenated(&result.uniplanar), parameters.leaf_mm);
    result.note_merged();
    observer.progress(Stage::Downsampling, 1.0);
    let mut result = result.unless_empty("the tests of the slices")?;

    enter(observer, Stage::Outliers)?;
    let keep = radius_outlier::kept(&result.triplanar.points, &parameters.radius_outlier);
    retain(&mut result.triplanar, &keep);
    result.figures.after_radius = count(&result.triplanar);
    let mut result = result.unless_empty("radius outlier removal")?;
    progress(observer, Stage::Outliers, 0.3)?;

    let keep = statistical_outlier::kept(&result.triplanar.points, &parameters.statistical_outlier);
    retain(&mut result.triplanar, &keep);
    result.figures.after_statistical = count(&result.triplanar);
    let mut result = result.unless_empty("statistical outlier removal")?;
    progress(observer, Stage::Outliers, 0.8)?;

    result.mark_unique(parameters.unique_distance_mm);
    observer.progress(Stage::Outliers, 1.0);
    Ok(result)
}

fn enter(observer: &dyn Observer, stage: Stage) -> Result<(), PipelineError> {
    progress(observer, stage, 0.0)
}

fn progress(observer: &dyn Observer, stage: Stage, fraction: f64) -> Result<(), PipelineError> {
    observer.progress(stage, fraction);
    if observer.cancelled() { Err(PipelineError::Cancelled) } else { Ok(()) }
}

fn count(cloud: &PointCloud) -> u64 {
    cloud.len() as u64
}

/// The clouds one after the other.
fn concatenated(clouds: &[PointCloud; 3]) -> PointCloud {
    let mut whole = PointCloud::default();
    for cloud in clouds {
        whole.points.extend_from_slice(&cloud.points);
        whole.planes.extend_from_slice(&cloud.planes);
        whole.unique.extend_from_slice(&cloud.unique);
    }
    whole
}

fn retain(cloud: &mut PointCloud, keep: &[bool]) {
    fn retain<T>(list: &mut Vec<T>, keep: &[bool]) {
        let mut keep = keep.iter();
        list.retain(|_| keep.next().is_some_and(|&k| k));
    }
    retain(&mut cloud.points, keep);
    retain(&mut cloud.planes, keep);
    retain(&mut cloud.unique, keep);
}

impl Reconstruction {
    fn note_merged(&mut self) {
        let figures = &mut self.figures;
        figures.downsampled = self.uniplanar.each_ref().map(count);
        figures.merged = count(&self.triplanar);
        let axial = figures.downsampled[Plane::Axial.index()];
        figures.additional_over_axial = figures.merged.cast_signed() - axial.cast_signed();
        figures.additional_share = share(figures.additional_over_axial, axial);
    }

    /// Marks the unique points of every cloud and counts those of the result.
    fn mark_unique(&mut self, distance_mm: f32) {
        let axial = self.uniplanar[Plane::Axial.index()].points.clone();
        for cloud in self.uniplanar.iter_mut().chain([&mut self.triplanar]) {
            cloud.unique = unique(&cloud.points, &axial, distance_mm);
        }
        self.figures.unique = self.triplanar.unique.iter().filter(|&&u| u).count() as u64;
        self.figures.unique_share = share(self.figures.unique.cast_signed(), self.figures.after_statistical);
    }

    fn unless_empty(self, stage: &'static str) -> Result<Self, PipelineError> {
        if self.triplanar.is_empty() {
            return Err(PipelineError::EmptyCloud { stage, partial: Box::new(self) });
        }
        Ok(self)
    }
}

#[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53 points")]
fn share(part: i64, whole: u64) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}
