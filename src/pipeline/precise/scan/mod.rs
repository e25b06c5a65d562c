//! The first stage: the scan as a field in mm, where a voxel is, what the scan shows at a place, its levels
//! and its limits.

pub(crate) mod edge_spread;
pub(crate) mod empty_ends;
pub(crate) mod field_of_view;
pub(crate) mod levels;
pub(crate) mod sampler;
pub(crate) mod survey;

use super::no_skin::NoSkin;
use crate::observer::{Observer, Stage, StageFiles};
use empty_ends::Slices;
use field_of_view::FieldOfView;
use levels::Levels;
use sampler::Sampler;

/// The scan as all later stages read it.
pub(crate) struct Scan<'a> {
    /// Voxels by index and by place.
    pub(crate) sampler: Sampler<'a>,
    /// Air, soft tissue and noise, HU.
    pub(crate) levels: Levels,
    /// Which part of the images was reconstructed.
    pub(crate) field_of_view: FieldOfView,
    observer: &'a dyn Observer,
}

impl<'a> Scan<'a> {
    /// Reads the levels and the field of view off some slices.
    ///
    /// # Errors
    /// [`NoSkin::NoVolume`], [`NoSkin::NoLevels`].
    pub(crate) fn of(slices: &'a Slices<'_>, observer: &'a dyn Observer) -> Result<Self, NoSkin> {
        let sampler = slices.sampler(observer).ok_or(NoSkin::NoVolume)?;
        let levels = Levels::of(&sampler).ok_or(NoSkin::NoLevels)?;
        observer.progress(Stage::Patient, 0.0);
        sampler.ask();
        let field_of_view = FieldOfView::of(&sampler, &levels);
        Ok(Self { sampler, levels, field_of_view, observer })
    }

    /// Who takes what the stages hand on.
    pub(crate) fn stage_files(&self) -> Option<&dyn StageFiles> {
        self.observer.stage_files()
    }

    /// Tells how far a stage is, and stops here if the observer says so.
    pub(crate) fn tell(&self, stage: Stage, fraction: f64) {
        self.observer.progress(stage, fraction);
        self.sampler.ask();
    }
}
