//! The profile `precise` as a [`Reconstruction`]: its points as clouds, its stretches as a row for
//! every slice.

use std::collections::HashMap;

use super::{BorderPoint, NoSkin, QualityLimits, Skin, SkinPoint, SliceContour, Stretch};
use crate::cloud::PointCloud;
use crate::dicom::Volume;
use crate::geometry::Plane;
use crate::observer::stop::Asked;
use crate::observer::{Observer, Silent};
use crate::pipeline::parameters::Parameters;
use crate::pipeline::result::figures::count;
use crate::pipeline::result::{
    Contours, Figures, PipelineError, Reason, Reconstruction, Rejection, SliceRow,
};
use crate::pipeline::{precise, slices};

/// # Errors
/// [`PipelineError::NoSkin`] or [`PipelineError::EmptyCloud`] with a row for every slice if there is
/// no point, [`PipelineError::Cancelled`] if the observer asks for it.
pub(crate) fn reconstruct(
    volume: &Volume,
    parameters: &Parameters,
    observer: &dyn Observer,
) -> Result<Reconstruction, PipelineError> {
    let shape = volume.grid.shape();
    let leaf_mm = f64::from(parameters.leaf_mm);
    let asked = Asked::of(observer);
    let skin = match precise::reconstruct(volume, leaf_mm, &parameters.quality, observer) {
        Ok(skin) => skin,
        Err(NoSkin::Cancelled) => return Err(PipelineError::Cancelled),
        Err(cause) => return Err(PipelineError::NoSkin { cause, partial: Box::new(nothing(shape)) }),
    };
    let Skin { points, uniplanar, quality, slices, border, measured } = skin;
    let mut result = Reconstruction {
        triplanar: cloud(asked, points),
        uniplanar: uniplanar.map(|points| cloud(asked, points)),
        figures: Figures { raw: measured, ..Figures::default() },
        slices: rows(asked, shape, &slices, &border),
        quality: Some(quality),
        contours: Contours::Border(border),
    };
    result.note_merged();
    result.figures.after_radius = count(&result.triplanar);
    result.figures.after_statistical = count(&result.triplanar);
    result.mark_unique(parameters.unique_distance_mm, observer)?;
    result.unless_empty("measuring the skin")
}

/// Every crossing of the patient's border with a grid line of the scan, as `precise` finds and judges
/// it, whatever the parameters; none where it finds no skin. For pictures ([`crate::pipeline::border_picture`]).
#[must_use]
pub fn border(volume: &Volume) -> Vec<BorderPoint> {
    /// Few points are made for nothing.
    const COARSE_MM: f64 = 20.0;
    let skin = precise::reconstruct(volume, COARSE_MM, &QualityLimits::default(), &Silent);
    skin.map_or_else(|_| Vec::new(), |skin| skin.border)
}

fn cloud(asked: Asked<'_>, points: Vec<SkinPoint>) -> PointCloud {
    let asking = || points.iter().enumerate().inspect(|(number, _)| asked.ask_at(*number));
    let cloud = PointCloud {
        points: asking().map(|(_, point)| point.place).collect(),
        planes: asking().map(|(_, point)| point.planes).collect(),
        unique: vec![false; points.len()],
        normals: asking().map(|(_, point)| point.normal).collect(),
        errors: asking().map(|(_, point)| point.error).collect(),
    };
    asked.free(points);
    cloud
}

/// No skin was found: no slice has a contour of it.
fn nothing(shape: [usize; 3]) -> Reconstruction {
    Reconstruction {
        triplanar: PointCloud::default(),
        uniplanar: Default::default(),
        figures: Figures::default(),
        slices: rows(Asked::default(), shape, &[], &[]),
        quality: None,
        contours: Contours::Border(Vec::new()),
    }
}

/// A row for every slice of the volume: axial, then sagittal, then coronal, each by index.
fn rows(
    asked: Asked<'_>,
    shape: [usize; 3],
    contours: &[SliceContour],
    border: &[BorderPoint],
) -> Vec<SliceRow> {
    let contours: HashMap<_, _> = contours.iter().map(|c| ((c.plane, c.index), c)).collect();
    let mut crossings: HashMap<(Plane, usize), usize> = HashMap::new();
    for (number, point) in border.iter().enumerate() {
        asked.ask_at(number);
        for plane in Plane::ALL {
            if let Some(index) = slice_of(point, plane) {
                *crossings.entry((plane, index)).or_default() += 1;
            }
        }
    }
    let slices = Plane::ALL
        .into_iter()
        .flat_map(|plane| (0..slices::count(shape, plane)).map(move |index| (plane, index)));
    slices
        .map(|(plane, index)| {
            let contour = contours.get(&(plane, index));
            let accepted_mm = contour.map_or(0.0, |contour| contour.accepted_mm);
            let stretches = contour.map_or_else(Vec::new, |contour| contour.rejected.clone());
            SliceRow {
                plane,
                index,
                rejection: (accepted_mm <= 0.0).then(|| whole_slice(&stretches)),
                contour_area: None,
                solidity: None,
                contour_points: crossings.get(&(plane, index)).copied().unwrap_or(0),
                carried_area: (None, None),
                accepted_mm: Some(accepted_mm),
                stretches,
            }
        })
        .collect()
}

/// Why nothing of a slice's contour was accepted: as its longest stretch, or because it has none.
fn whole_slice(stretches: &[Stretch]) -> Rejection {
    // Of stretches of one length the first counts.
    let longest = stretches.iter().rev().max_by(|a, b| a.length_mm.total_cmp(&b.length_mm));
    match longest {
        Some(Stretch { reason, measured, limit, .. }) => {
            Rejection { reason: Reason::Stretch(*reason), measured: *measured, limit: *limit }
        }
        None => Rejection::count(Reason::NoContour, 0, 1),
    }
}

/// The slice of `plane` that a point of the border lies in. A grid line that runs across the slices
/// lies in none of them.
pub(crate) fn slice_of(point: &BorderPoint, plane: Plane) -> Option<usize> {
    let axis = slices::axis(plane) as usize;
    let place = point.index[axis].round();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked, and few slices")]
    let index = (place >= 0.0).then_some(place as usize);
    index.filter(|_| usize::from(point.axis) != axis)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::Decision;

    fn stretch(length_mm: f64, measured: f64) -> Stretch {
        let reason = precise::StretchReason::Touching;
        Stretch { reason, length_mm, measured, limit: 3.0 }
    }

    #[test]
    fn every_slice_has_a_row_and_a_wholly_rejected_one_the_reason_of_its_longest_stretch() {
        let contour =
            |plane, index, accepted_mm, rejected| SliceContour { plane, index, accepted_mm, rejected };
        let contours = [
            contour(Plane::Axial, 1, 80.0, vec![]),
            contour(Plane::Sagittal, 2, 10.0, vec![stretch(5.0, 1.0)]),
            contour(Plane::Coronal, 0, 0.0, vec![stretch(5.0, 1.0), stretch(7.0, 2.0), stretch(7.0, 2.5)]),
        ];
        // On a line along x, at z 1 and y 0: in the axial and in the coronal slice.
        let point = BorderPoint { index: [1.0, 0.0, 2.4], axis: 2, reason: None };
        let rows = rows(Asked::default(), [2, 3, 4], &contours, &[point]);
        let at = |plane, index| {
            rows.iter().find(|row| (row.plane, row.index) == (plane, index)).expect("a row for every slice")
        };
        assert_eq!(rows.len(), 2 + 4 + 3);
        assert!(rows.is_sorted_by_key(|row| (row.plane, row.index)));
        assert_eq!(at(Plane::Axial, 1).decision(), Decision::Accepted);
        assert_eq!(at(Plane::Sagittal, 2).decision(), Decision::Partly);
        let none = at(Plane::Axial, 0).rejection.expect("it has no contour");
        assert_eq!((none.reason, at(Plane::Axial, 0).accepted_mm), (Reason::NoContour, Some(0.0)));
        let longest = at(Plane::Coronal, 0).rejection.expect("nothing was accepted");
        let touching = Reason::Stretch(precise::StretchReason::Touching);
        assert_eq!(longest, Rejection { reason: touching, measured: 2.0, limit: 3.0 });
        let with_point: Vec<_> = rows.iter().filter(|row| row.contour_points == 1).collect();
        assert_eq!(with_point, [at(Plane::Axial, 1), at(Plane::Coronal, 0)]);
    }
}
