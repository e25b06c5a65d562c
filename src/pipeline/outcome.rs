//! What a reconstruction gives.

use serde::{Deserialize, Serialize};

use super::contour::Pixel;
use super::effort::Effort;
use super::precise::{BorderPoint, NoSkin, Quality, Stretch};
use super::rejection::Rejection;
use super::unique::unique_within;
use crate::cloud::PointCloud;
use crate::geometry::Plane;
use crate::observer::Observer;
use crate::observer::stop::Stopped;

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

/// What became of a slice's contour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Decision {
    /// All of it went into the cloud.
    Accepted,
    /// Some stretches of it were rejected; the rest went into the cloud. Profile `precise` alone.
    Partly,
    /// Nothing of it went into the cloud.
    Rejected,
}

/// The decision on one slice.
#[derive(Debug, Clone, PartialEq)]
pub struct SliceRow {
    /// The plane.
    pub plane: Plane,
    /// Index within the plane: axial from the top, sagittal from the patient's right, coronal from
    /// the back.
    pub index: usize,
    /// Why nothing of it was accepted; `None` if anything was. Of several rejected stretches it is
    /// the longest one's.
    pub rejection: Option<Rejection>,
    /// Area of the cut contour in px², if there is one.
    pub contour_area: Option<f64>,
    /// Contour area / area of its convex hull.
    pub solidity: Option<f64>,
    /// Number of pixels of the cut contour (`paper`), or of crossings of the patient's border with
    /// the slice's grid lines (`precise`).
    pub contour_points: usize,
    /// Carried area before and after the slice, px².
    pub carried_area: (Option<f64>, Option<f64>),
    /// Accepted contour, mm; profile `precise` alone.
    pub accepted_mm: Option<f64>,
    /// The stretches of the contour that were rejected; profile `precise` alone.
    pub stretches: Vec<Stretch>,
}

impl SliceRow {
    /// What became of the contour.
    #[must_use]
    pub fn decision(&self) -> Decision {
        match self.rejection {
            Some(_) => Decision::Rejected,
            None if self.stretches.is_empty() => Decision::Accepted,
            None => Decision::Partly,
        }
    }
}

/// The figures that the paper reports for each result (its section 3), and the points after each
/// stage. All are counts of points unless they say share. `precise` has no filters after merging:
/// its counts of merging and of both filters are that of the final cloud.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Figures {
    /// Contour pixels lifted into patient space (`paper`), crossings measured (`precise`): axial,
    /// sagittal, coronal.
    pub raw: [u64; 3],
    /// Contour pixels of accepted slices that were left out: they lie outside the bounding box of the
    /// axial points in x and y. Axial (always 0), sagittal, coronal.
    #[serde(default)]
    pub outside_axial_box: [u64; 3],
    /// Points of each plane's own cloud, one a cell or leaf: axial, sagittal, coronal.
    pub downsampled: [u64; 3],
    /// After merging and the second voxel grid.
    pub merged: u64,
    /// After radius outlier removal.
    pub after_radius: u64,
    /// After statistical outlier removal: the final cloud.
    pub after_statistical: u64,
    /// Points of the final cloud with no axial point within 1 mm.
    pub unique: u64,
    /// `unique` / final, 0 to 1.
    pub unique_share: f64,
    /// Points of the merged cloud beyond those of the axial one (may be negative).
    pub additional_over_axial: i64,
    /// `additional_over_axial` / axial downsampled, 0 to 1.
    pub additional_share: f64,
}

/// Why the pipeline gave no cloud.
#[derive(Debug, Clone, thiserror::Error)]
pub enum PipelineError {
    /// Not one point is left. The rows tell which tests rejected the slices.
    #[error("no point of skin is left after {stage}: see the report for the reason of every slice")]
    EmptyCloud {
        /// The step after which nothing was left.
        stage: &'static str,
        /// What was found up to there.
        partial: Box<Reconstruction>,
    },
    /// The profile `precise` found no skin.
    #[error("{cause}")]
    NoSkin {
        /// Why.
        cause: NoSkin,
        /// A row for every slice, all of them rejected.
        partial: Box<Reconstruction>,
    },
    /// The points and the parameters together ask for more than may be computed.
    #[error(
        "with these points {parameters} ask for {tests} tests of distances; {limit} are allowed: choose a larger \
         leaf_mm, or a smaller radius or fewer neighbours"
    )]
    TooCostly {
        /// The parameters that decide how much there is to do.
        parameters: &'static str,
        /// Tests of distances, at least.
        tests: u64,
        /// The limit.
        limit: u64,
    },
    /// The observer asked to stop.
    #[error("cancelled")]
    Cancelled,
}

impl From<Stopped> for PipelineError {
    fn from(Stopped: Stopped) -> Self {
        Self::Cancelled
    }
}

impl PipelineError {
    /// The stable code of a reconstruction that failed for it.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::EmptyCloud { .. } => "empty_cloud",
            Self::NoSkin { cause, .. } => cause.code(),
            Self::TooCostly { .. } => "too_costly",
            Self::Cancelled => "cancelled",
        }
    }
}

impl Reconstruction {
    /// Counts the points of each plane and of the merged cloud, and those beyond the axial ones.
    pub(super) fn note_merged(&mut self) {
        let figures = &mut self.figures;
        figures.downsampled = self.uniplanar.each_ref().map(count);
        figures.merged = count(&self.triplanar);
        let axial = figures.downsampled[Plane::Axial.index()];
        figures.additional_over_axial = figures.merged.cast_signed() - axial.cast_signed();
        figures.additional_share = share(figures.additional_over_axial, axial);
    }

    /// Marks the unique points of every cloud and counts those of the result.
    ///
    /// # Errors
    /// [`PipelineError::Cancelled`], [`PipelineError::TooCostly`].
    pub(super) fn mark_unique(
        &mut self,
        distance_mm: f32,
        observer: &dyn Observer,
    ) -> Result<(), PipelineError> {
        let axial = self.uniplanar[Plane::Axial.index()].points.clone();
        let effort = Effort::of(observer, "leaf_mm and unique_distance_mm");
        for cloud in self.uniplanar.iter_mut().chain([&mut self.triplanar]) {
            cloud.unique = unique_within(&cloud.points, &axial, distance_mm, &effort)?;
        }
        self.figures.unique = self.triplanar.unique.iter().filter(|&&u| u).count() as u64;
        self.figures.unique_share = share(self.figures.unique.cast_signed(), self.figures.after_statistical);
        Ok(())
    }

    pub(super) fn unless_empty(self, stage: &'static str) -> Result<Self, PipelineError> {
        if self.triplanar.is_empty() {
            return Err(PipelineError::EmptyCloud { stage, partial: Box::new(self) });
        }
        Ok(self)
    }
}

pub(super) fn count(cloud: &PointCloud) -> u64 {
    cloud.len() as u64
}

#[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53 points")]
fn share(part: i64, whole: u64) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}
