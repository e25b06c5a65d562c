//! What one upload may hold, however many archives and files it is spread over.

use crate::config::Http;
use crate::error::{Error, Result};

/// What is left of an upload's limits. It wanders from archive to archive.
#[derive(Debug, Clone, Copy)]
pub(in crate::http) struct Budget {
    max_entries: u64,
    max_unpacked_bytes: u64,
    entries_left: u64,
    unpacked_left: u64,
}

impl Budget {
    /// `http.max_archive_entries` and `http.max_unpacked_bytes`, whole.
    pub(in crate::http) fn new(settings: &Http) -> Self {
        Self {
            max_entries: settings.max_archive_entries,
            max_unpacked_bytes: settings.max_unpacked_bytes,
            entries_left: settings.max_archive_entries,
            unpacked_left: settings.max_unpacked_bytes,
        }
    }

    /// Whether so many entries more would be let through.
    ///
    /// # Errors
    /// [`Error::ArchiveTooLarge`] if not.
    pub(super) fn check_entries(&self, entries: u64) -> Result<()> {
        if entries > self.entries_left {
            return Err(Error::ArchiveTooLarge(format!(
                "more than {} files in one upload (http.max_archive_entries)",
                self.max_entries
            )));
        }
        Ok(())
    }

    /// Whether so many unpacked bytes more would be let through.
    ///
    /// # Errors
    /// [`Error::ArchiveTooLarge`] if not.
    pub(super) fn check_unpacked(&self, bytes: u64) -> Result<()> {
        if bytes > self.unpacked_left {
            return Err(Error::ArchiveTooLarge(format!(
                "more than {} bytes unpacked in one upload (http.max_unpacked_bytes)",
                self.max_unpacked_bytes
            )));
        }
        Ok(())
    }

    /// Counts an entry of an archive, a file of a form, a part of a STOW-RS request.
    ///
    /// # Errors
    /// [`Error::ArchiveTooLarge`] if it is one too many.
    pub(in crate::http) fn entry(&mut self) -> Result<()> {
        self.check_entries(1)?;
        self.entries_left -= 1;
        Ok(())
    }

    /// Counts bytes that came out of an archive.
    ///
    /// # Errors
    /// [`Error::ArchiveTooLarge`] if they are too many.
    pub(super) fn unpacked(&mut self, bytes: u64) -> Result<()> {
        self.check_unpacked(bytes)?;
        self.unpacked_left -= bytes;
        Ok(())
    }

    /// Counts `bytes` in place of all that was unpacked since `earlier`.
    ///
    /// # Errors
    /// [`Error::ArchiveTooLarge`] if they are too many.
    pub(super) fn unpacked_since(&mut self, earlier: &Self, bytes: u64) -> Result<()> {
        self.unpacked_left = earlier.unpacked_left;
        self.unpacked(bytes)
    }
}
