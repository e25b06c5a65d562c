//! The last stage: the skin, how far to trust it, and what became of the rest.

use super::cloud::clouds::Clouds;
use super::cloud::point::SkinPoint;
use super::confidence::motion::largest_step;
use super::report::assess::{self, Areas};
use super::report::border::{BorderPoint, border_points};
use super::report::quality::{Quality, QualityLimits};
use super::report::stretches::{SliceContour, across, rows};
use super::rules::Verdicts;
use super::scan::Scan;
use crate::geometry::Plane;
use crate::observer::Stage;

/// What of a skin a user chooses.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wish<'a> {
    /// Edge of the leaf that has one point, mm.
    pub(super) leaf_mm: f64,
    /// The limits of the verdict.
    pub(super) limits: &'a QualityLimits,
    /// Slices that don't go with their neighbours, as the series' reader counts them.
    pub(super) doubtful_slices: usize,
}

/// The skin of a head.
#[derive(Debug, Clone)]
pub struct Skin {
    /// One point for each leaf, in level-of-detail order: the first N are a coarse cloud.
    pub points: Vec<SkinPoint>,
    /// The same of each plane alone, in the order of [`Plane::ALL`].
    pub uniplanar: [Vec<SkinPoint>; 3],
    /// How far it can be trusted.
    pub quality: Quality,
    /// A row for every slice with any contour: axial, then sagittal, then coronal, by index.
    pub slices: Vec<SliceContour>,
    /// Every crossing of the patient's border with a grid line, accepted or not: the contours of
    /// all slices, for pictures.
    pub border: Vec<BorderPoint>,
    /// Crossings measured, for each plane: axial, sagittal, coronal.
    pub measured: [u64; 3],
}

impl Skin {
    /// One point for each leaf, with its error; and the report on the whole.
    pub(super) fn of(scan: &Scan<'_>, verdicts: &Verdicts, wish: &Wish<'_>) -> Self {
        let sampler = &scan.sampler;
        let Verdicts { patient, head, .. } = verdicts;
        let (all, accepted, rejected) = (verdicts.all(), &verdicts.accepted, &verdicts.rejected);
        scan.tell(Stage::Downsampling, 0.0);
        // What one thread does alone, beside what all do.
        let (clouds, ((slices, border), (areas, motion_mm))) = rayon::join(
            || Clouds::of(sampler, &verdicts.edge_spread, all, wish.leaf_mm),
            || {
                rayon::join(
                    || (rows(sampler, accepted, rejected), border_points(sampler, accepted, rejected)),
                    || {
                        sampler.ask();
                        let areas = Areas::of(sampler, patient, head, accepted, rejected);
                        sampler.ask();
                        (areas, largest_step(sampler, all, head.middle))
                    },
                )
            },
        );
        let measured = assess::Measured {
            edge_spread: &verdicts.edge_spread,
            areas: &areas,
            motion_mm,
            points: &clouds.agreements,
        };
        let quality = assess::quality(scan, head, &measured);
        let quality = Quality { doubtful_slices: wish.doubtful_slices, ..quality }.judge(wish.limits);
        scan.tell(Stage::Downsampling, 1.0);
        let Clouds { points, uniplanar, measured, agreements } = clouds;
        sampler.asked().free(agreements);
        Self { points, uniplanar, quality, slices, border, measured }
    }

    /// Counts the slices across an axis `[z, y, x]` of the volume from so many before the first.
    pub(super) fn counted_from(mut self, axis: usize, before: usize) -> Self {
        if before == 0 {
            return self;
        }
        for slice in self.slices.iter_mut().filter(|slice| across(slice.plane) == axis) {
            slice.index += before;
        }
        for point in &mut self.border {
            point.index[axis] += before as f32;
        }
        self
    }

    /// The points of one plane.
    #[must_use]
    pub fn in_plane(&self, plane: Plane) -> &[SkinPoint] {
        &self.uniplanar[plane.index()]
    }
}
