//! What a reconstruction gives.

use super::figures::{Figures, count, share};
use super::slice_row::SliceRow;
use crate::cloud::PointCloud;
use crate::geometry::Plane;
use crate::observer::stop::Asked;
use crate::pipeline::precise::{BorderPoint, Quality};
use crate::pipeline::slices::Pixel;

/// Clouds, figures and a row for every slice, of one run of the pipeline.
#[derive(Debug, Clone)]
pub struct Reconstruction {
    /// The result: of `paper` the merged, downsampled cloud without outliers, of `precise` one point a
    /// leaf. LPS mm.
    pub triplanar: PointCloud,
    /// The downsampled cloud of each plane alone, in the order of [`Plane::ALL`]. LPS mm.
    pub uniplanar: [PointCloud; 3],
    /// The paper's figures.
    pub figures: Figures,
    /// One row for every slice: axial, then sagittal, then coronal, each by index.
    pub slices: Vec<SliceRow>,
    /// How far the result can be trusted; profile `precise` alone.
    pub quality: Option<Quality>,
    /// The contours of the slices, for pictures.
    pub contours: Contours,
}

/// The contours of all slices as pictures show them.
#[derive(Debug, Clone)]
pub enum Contours {
    /// Profile `paper`: the pixels of each row's contour, accepted or not.
    Pixels(Vec<Vec<Pixel>>),
    /// Profile `precise`: every crossing of the patient's border with a grid line of the scan.
    Border(Vec<BorderPoint>),
}

impl Contours {
    /// Whether they are pixels of slices.
    #[must_use]
    pub fn are_pixels(&self) -> bool {
        matches!(self, Self::Pixels(_))
    }
}

impl Reconstruction {
    /// Drops it, asking.
    pub(crate) fn free(self, asked: Asked<'_>) {
        for cloud in self.uniplanar.into_iter().chain([self.triplanar]) {
            asked.free(cloud.points);
            asked.free(cloud.normals);
            asked.free(cloud.errors);
        }
        match self.contours {
            Contours::Border(border) => asked.free(border),
            Contours::Pixels(contours) => contours.into_iter().for_each(|pixels| {
                asked.ask();
                drop(pixels);
            }),
        }
    }

    /// Counts the points of each plane and of the merged cloud, and those beyond the axial ones.
    pub(crate) fn note_merged(&mut self) {
        let figures = &mut self.figures;
        figures.downsampled = self.uniplanar.each_ref().map(count);
        figures.merged = count(&self.triplanar);
        let axial = figures.downsampled[Plane::Axial.index()];
        figures.additional_over_axial = figures.merged.cast_signed() - axial.cast_signed();
        figures.additional_share = share(figures.additional_over_axial, axial);
    }
}
