//! What the profile gives: points of skin, or the reason why there are none.

use super::border::crossing::Crossing;
use super::reason::StretchReason;
use super::report::quality::Quality;
use super::report::stretches::{SliceContour, across};
use crate::geometry::{Plane, PlaneSet, Vec3};

/// A measured point of the skin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkinPoint {
    /// LPS mm.
    pub place: [f32; 3],
    /// Outward unit normal of the surface that its neighbours within 2 mm make, LPS.
    pub normal: [f32; 3],
    /// Expected error along the normal, mm.
    pub error: f32,
    /// The planes whose points it stands for.
    pub planes: PlaneSet,
}

impl SkinPoint {
    pub(crate) fn of(crossing: &Crossing, normal: Vec3, error: f64, planes: PlaneSet) -> Self {
        let single = |v: Vec3| v.map(|v| v as f32);
        Self { place: single(crossing.place), normal: single(normal), error: error as f32, planes }
    }
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

/// A place where a grid line crosses the border of the patient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BorderPoint {
    /// Fractional voxel index `[z, y, x]`: whole along the two axes that the line does not follow.
    pub index: [f32; 3],
    /// The array axis that the line follows: 0 z, 1 y, 2 x. The point lies in the slices of the
    /// two planes at right angles to the others.
    pub axis: u8,
    /// Why it was not accepted as skin; `None` for an accepted one.
    pub reason: Option<StretchReason>,
}

impl Skin {
    /// Counts the slices across an axis `[z, y, x]` of the volume from so many before the first.
    pub(crate) fn count_from(&mut self, axis: usize, before: usize) {
        for slice in self.slices.iter_mut().filter(|slice| across(slice.plane) == axis) {
            slice.index += before;
        }
        for point in &mut self.border {
            point.index[axis] += before as f32;
        }
    }

    /// The points of one plane.
    #[must_use]
    pub fn of(&self, plane: Plane) -> &[SkinPoint] {
        &self.uniplanar[plane.index()]
    }
}

impl NoSkin {
    /// The stable code of a reconstruction that failed for it.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::NoVolume => "no_volume",
            Self::NoLevels => "no_tissue",
            Self::NoPatient => "no_patient",
            Self::NoHead { .. } => "no_head",
            Self::NoBorder => "empty_cloud",
            Self::Cancelled => "cancelled",
        }
    }
}

/// Why there is no skin.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NoSkin {
    /// The volume has fewer than two voxels along an axis, or slices at one place.
    #[error("the volume is too small to hold a surface: a head needs a stack of slices, not a scout")]
    NoVolume,
    /// The histogram shows no air or no soft tissue.
    #[error("the scan shows no air or no soft tissue: are the values Hounsfield units?")]
    NoLevels,
    /// Nothing in the scan can be a patient: it is thin, or alike in all slices, as a couch is.
    #[error(
        "no patient in the scan: nothing in it is thicker than 10 mm and not alike in all slices, as a couch is"
    )]
    NoPatient,
    /// Not enough soft tissue lies within bone to be a brain.
    #[error(
        "no head in the scan: {brain_cm3:.0} cm³ of soft tissue lie within bone, a head has at least {limit_cm3:.0}"
    )]
    NoHead {
        /// Soft tissue within bone, cm³.
        brain_cm3: f64,
        /// The least that is taken for a head, cm³.
        limit_cm3: f64,
    },
    /// The patient's border to the air outside was nowhere accepted.
    #[error("no border of the patient to the air outside could be accepted")]
    NoBorder,
    /// The observer asked to stop.
    #[error("cancelled")]
    Cancelled,
}
