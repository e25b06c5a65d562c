//! How long work tells how far it is, and is told to stop: what reads a series ([`crate::dicom`]) and what
//! reconstructs it ([`crate::pipeline`]) are watched alike.

mod stage;
pub(crate) mod stop;

pub use stage::Stage;

/// What a stage of a reconstruction hands on, as a file that other programs open.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StageFile {
    /// The file's name, the same in every reconstruction.
    pub name: &'static str,
    /// Its bytes.
    pub content: Vec<u8>,
}

/// Takes the files of the stages.
pub trait StageFiles: Sync {
    /// Takes one.
    fn take(&self, file: StageFile);
}

/// Watches a reconstruction from outside. Called from several threads.
pub trait Observer: Sync {
    /// `fraction` of `stage` is done, 0 to 1.
    fn progress(&self, stage: Stage, fraction: f64);
    /// Whether the work should stop now; asked at least once a slice.
    fn cancelled(&self) -> bool {
        false
    }
    /// Who takes what the stages hand on; nobody unless somebody wants to look at it.
    fn stage_files(&self) -> Option<&dyn StageFiles> {
        None
    }
}

/// Nobody watches.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Observer for Silent {
    fn progress(&self, _: Stage, _: f64) {}
}
