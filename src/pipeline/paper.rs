//! The profile `paper`: the published pipeline, step by step.

use super::contour::Pixel;
use super::decisions::{Decisions, decide};
use super::lift::{lift_asking, outside_axial_box};
use super::outcome::{Contours, Figures, PipelineError, Reconstruction, count};
use super::parameters::Parameters;
use super::voxel_grid::voxel_grid_asking;
use super::{radius_outlier, statistical_outlier};
use crate::cloud::PointCloud;
use crate::dicom::Volume;
use crate::observer::stop::Asked;
use crate::observer::{Observer, Stage};

/// Reconstructs the skin surface of a head from a CT volume (paper, section 2).
///
/// # Errors
/// [`PipelineError::EmptyCloud`] with everything found so far if no point is left,
/// [`PipelineError::Cancelled`] if the observer asks for it.
pub(super) fn reconstruct(
    volume: &Volume,
    parameters: &Parameters,
    observer: &dyn Observer,
) -> Result<Reconstruction, PipelineError> {
    let mut decisions = decide(&volume.hu, parameters, observer)?;

    enter(observer, Stage::Downsampling)?;
    let asked = Asked::of(observer);
    let raw = lift_asking(asked, &decisions, &volume.grid);
    let thinned = |cloud: &PointCloud| {
        let thinned = voxel_grid_asking(asked, cloud, parameters.leaf_mm);
        progress(observer, Stage::Downsampling, 0.0).map(|()| thinned)
    };
    let [axial, sagittal, coronal] = &raw;
    let mut result = Reconstruction {
        triplanar: PointCloud::default(),
        uniplanar: [thinned(axial)?, thinned(sagittal)?, thinned(coronal)?],
        figures: Figures {
            raw: raw.each_ref().map(count),
            outside_axial_box: outside_axial_box(&decisions, &raw),
            ..Figures::default()
        },
        contours: Contours::Pixels(contours(&mut decisions)),
        slices: decisions.rows,
        quality: None,
    };
    drop(raw);
    asked.ask();
    result.triplanar = voxel_grid_asking(asked, &concatenated(&result.uniplanar), parameters.leaf_mm);
    result.note_merged();
    progress(observer, Stage::Downsampling, 1.0)?;
    let mut result = result.unless_empty("the tests of the slices")?;

    enter(observer, Stage::Outliers)?;
    let keep = radius_outlier::kept(&result.triplanar.points, &parameters.radius_outlier, observer)?;
    result.triplanar.retain(&keep);
    result.figures.after_radius = count(&result.triplanar);
    let mut result = result.unless_empty("radius outlier removal")?;
    progress(observer, Stage::Outliers, 0.3)?;

    let filter = &parameters.statistical_outlier;
    let keep = statistical_outlier::kept(&result.triplanar.points, filter, observer)?;
    result.triplanar.retain(&keep);
    result.figures.after_statistical = count(&result.triplanar);
    let mut result = result.unless_empty("statistical outlier removal")?;
    progress(observer, Stage::Outliers, 0.8)?;

    result.mark_unique(parameters.unique_distance_mm, observer)?;
    observer.progress(Stage::Outliers, 1.0);
    Ok(result)
}

/// The contour of every slice, accepted or not.
fn contours(decisions: &mut Decisions) -> Vec<Vec<Pixel>> {
    let (accepted, rejected) =
        (std::mem::take(&mut decisions.contours), std::mem::take(&mut decisions.rejected));
    accepted
        .into_iter()
        .zip(rejected)
        .map(|(accepted, rejected)| if accepted.is_empty() { rejected } else { accepted })
        .collect()
}

fn enter(observer: &dyn Observer, stage: Stage) -> Result<(), PipelineError> {
    progress(observer, stage, 0.0)
}

fn progress(observer: &dyn Observer, stage: Stage, fraction: f64) -> Result<(), PipelineError> {
    observer.progress(stage, fraction);
    if observer.cancelled() { Err(PipelineError::Cancelled) } else { Ok(()) }
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
