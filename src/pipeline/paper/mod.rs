//! The profile `paper`, that of Cvetić et al. 2025 (Bioengineering 12(5), 498: "the paper"), one file a step:
//!
//! | step | file | paper |
//! |---|---|---|
//! | a volume is cut into slices along three planes | [`crate::pipeline::slices`] | section 2.1 |
//! | tissue is white | [`mask`] | Algorithm 1 |
//! | the head's outermost contour | [`contour`] | section 2.2 |
//! | tests, the first that fails rejects the slice | [`rules`] | section 2.2, Algorithms 2 and 3 |
//! | the decision on every slice | [`decisions`] | section 2.2 |
//! | contour pixels become points in the patient | [`lift`] | Algorithm 4 |
//! | one point per cell | [`voxel_grid`] | section 2.3 |
//! | sparse and stray points are dropped | [`radius_outlier`], [`statistical_outlier`] | section 2.3 |
//! | what the axial cloud alone would not have | [`crate::pipeline::neighbours::unique`] | section 3.2 |
//!
//! What the paper leaves open is as in the program that its
//! authors published. Two of that program's ways are not taken: points are in true patient
//! coordinates, and so neither are two of the planes a slice too low nor is the lower part of a
//! volume with thick slices cut off.

pub mod bitmap;
#[cfg(test)]
mod cloud_tests;
pub mod contour;
pub mod decisions;
pub mod lift;
pub mod mask;
pub mod radius_outlier;
pub mod rules;
pub mod statistical_outlier;
pub mod voxel_grid;

use crate::cloud::PointCloud;
use crate::dicom::Volume;
use crate::observer::stop::Asked;
use crate::observer::{Observer, Stage};
use crate::pipeline::parameters::Parameters;
use crate::pipeline::result::figures::count;
use crate::pipeline::result::{Contours, Figures, PipelineError, Reconstruction};
use crate::pipeline::slices::Pixel;
use decisions::{Decisions, decide};
use lift::{lift_asking, outside_axial_box};
use voxel_grid::voxel_grid_asking;

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
    result.triplanar = voxel_grid_asking(asked, &concatenated(asked, &result.uniplanar), parameters.leaf_mm);
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
fn concatenated(asked: Asked<'_>, clouds: &[PointCloud; 3]) -> PointCloud {
    let mut whole = PointCloud::default();
    for cloud in clouds {
        asked.extend(&mut whole.points, &cloud.points);
        asked.extend(&mut whole.planes, &cloud.planes);
        asked.extend(&mut whole.unique, &cloud.unique);
    }
    whole
}
