//! From contour pixels to points in the patient (paper, section 2.3, Algorithm 4).

use super::decisions::Decisions;
use crate::cloud::PointCloud;
use crate::geometry::{Grid, Plane, PlaneSet};
use crate::observer::stop::Asked;
use crate::pipeline::slices;

/// The raw cloud of each plane, LPS mm, in the order of [`Plane::ALL`]: the pixels of the accepted
/// contours, each at its voxel's true place ([`Grid::lps`], computed in double precision).
///
/// Sagittal and coronal points are kept only inside the bounding box (inclusive) of the axial
/// points in x and y. The box is laid along the axes of the scan, as in the published program,
/// which knows no others; so it is exact for any orientation and tilt. Its z is the volume's
/// extent, which no voxel leaves. Where no axial slice was accepted the box is empty, and so are
/// the other planes.
#[must_use]
pub fn lift(decisions: &Decisions, grid: &Grid) -> [PointCloud; 3] {
    lift_asking(Asked::default(), decisions, grid)
}

/// The same, asking whether to stop.
pub(super) fn lift_asking(asked: Asked<'_>, decisions: &Decisions, grid: &Grid) -> [PointCloud; 3] {
    let bounds = Bounds::of_axial(asked, decisions, grid.shape());
    Plane::ALL.map(|plane| {
        let mut cloud = PointCloud::default();
        for (index, contour) in decisions.accepted(plane) {
            asked.ask();
            for &pixel in contour {
                let voxel = slices::voxel(grid.shape(), plane, index, pixel);
                if plane == Plane::Axial || bounds.contain(voxel) {
                    cloud.points.push(single(grid.lps(voxel)));
                }
            }
        }
        cloud.planes = vec![PlaneSet::from(plane); cloud.len()];
        cloud.unique = vec![false; cloud.len()];
        cloud
    })
}

/// How many contour pixels of each plane [`lift`] left out: those outside the box of the axial points.
#[must_use]
pub(super) fn outside_axial_box(decisions: &Decisions, raw: &[PointCloud; 3]) -> [u64; 3] {
    Plane::ALL.map(|plane| {
        let pixels: usize = decisions.accepted(plane).map(|(_, contour)| contour.len()).sum();
        (pixels - raw[plane.index()].len()) as u64
    })
}

#[expect(clippy::cast_possible_truncation, reason = "clouds are in single precision")]
fn single(point: [f64; 3]) -> [f32; 3] {
    point.map(|v| v as f32)
}

/// First and last y and x of the axial points, as voxel indices.
struct Bounds {
    y: (usize, usize),
    x: (usize, usize),
}

impl Bounds {
    fn of_axial(asked: Asked<'_>, decisions: &Decisions, shape: [usize; 3]) -> Self {
        let mut bounds = Self { y: (usize::MAX, 0), x: (usize::MAX, 0) };
        for (index, contour) in decisions.accepted(Plane::Axial) {
            asked.ask();
            for &pixel in contour {
                let [_, y, x] = slices::voxel(shape, Plane::Axial, index, pixel);
                bounds.y = (bounds.y.0.min(y), bounds.y.1.max(y));
                bounds.x = (bounds.x.0.min(x), bounds.x.1.max(x));
            }
        }
        bounds
    }

    fn contain(&self, [_, y, x]: [usize; 3]) -> bool {
        (self.y.0..=self.y.1).contains(&y) && (self.x.0..=self.x.1).contains(&x)
    }
}
