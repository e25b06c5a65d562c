//! The files of the stages, for those who look at how a decision was made.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use crate::cli::{Failed, output};
use crate::observer::{Observer, Stage, StageFile, StageFiles};
use crate::pipeline::Profile;

#[derive(Debug, clap::Args)]
pub(super) struct Dump {
    /// Folder for what the stages hand on (profile `precise`): labels as NRRD, border and verdicts as PLY
    #[arg(long = "dump", value_name = "DIR")]
    folder: Option<PathBuf>,
}

/// A reconstruction's observer that writes the files as they come.
pub(super) struct Dumping<'a, O> {
    watched_by: &'a O,
    folder: Option<PathBuf>,
    /// Why one could not be written; the first.
    failed: Mutex<Option<Failed>>,
}

impl Dump {
    /// Refuses what that profile can't give, makes the folder, and asks whether it can be written to.
    pub(super) fn check(&self, profile: Profile) -> Result<(), Failed> {
        let Some(folder) = &self.folder else { return Ok(()) };
        if profile != Profile::Precise {
            return Err(Failed::usage(format!(
                "--dump: the profile {} has no such stages: leave it out, or ask for {}",
                profile.name(),
                Profile::Precise.name()
            )));
        }
        std::fs::create_dir_all(folder)
            .map_err(|error| Failed::internal(format!("{} can't be made: {error}", folder.display())))?;
        output::check(&folder.join("labels.nrrd"))
    }

    /// Watches for another observer.
    pub(super) fn watch<'a, O: Observer>(&self, watched_by: &'a O) -> Dumping<'a, O> {
        Dumping { watched_by, folder: self.folder.clone(), failed: Mutex::default() }
    }
}

impl<O> Dumping<'_, O> {
    /// Tells what could not be written.
    pub(super) fn finish(self) -> Result<(), Failed> {
        self.failed.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), Err)
    }
}

impl<O: Observer> Observer for Dumping<'_, O> {
    fn progress(&self, stage: Stage, fraction: f64) {
        self.watched_by.progress(stage, fraction);
    }

    fn cancelled(&self) -> bool {
        self.watched_by.cancelled()
    }

    fn stage_files(&self) -> Option<&dyn StageFiles> {
        self.folder.is_some().then_some(self)
    }
}

impl<O: Observer> StageFiles for Dumping<'_, O> {
    fn take(&self, StageFile { name, content }: StageFile) {
        let Some(folder) = &self.folder else { return };
        if let Err(error) = output::write(&folder.join(name), &content) {
            self.failed.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        }
    }
}
