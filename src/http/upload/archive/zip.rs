//! Zip archives. The directory is read entry by entry, so that its claims cost no memory.

use std::fs::File;

use zip::ZipReadOptions;
use zip::read::Config;
use zip::result::ZipError;
use zip::unstable::read::ZipIterable;

use super::{Broken, Walk, malformed, told};
use crate::error::Result;
use crate::http::refused::SkipReason;

pub(super) fn walk(file: File, walk: &mut Walk) -> Result<()> {
    let mut contents = file.try_clone()?;
    let mut archive = ZipIterable::try_new(file, Config::default()).map_err(malformed)?;
    walk.budget.check_entries(archive.len() as u64)?;
    let mut claimed = 0_u64;
    for entry in archive.files().map_err(malformed)? {
        claimed = claimed.saturating_add(entry.map_err(malformed)?.size());
    }
    // An honest archive that is too large is refused before anything of it is stored.
    walk.budget.check_unpacked(claimed)?;
    for entry in archive.files().map_err(malformed)? {
        let entry = entry.map_err(malformed)?;
        walk.budget.entry()?;
        if entry.is_dir() {
            continue;
        }
        let name = told(entry.name_raw());
        if entry.encrypted() {
            walk.skip(&name, SkipReason::Encrypted)?;
            continue;
        }
        match entry.with_reader(&mut contents, ZipReadOptions::new()) {
            Ok(content) => walk.entry(&name, content, Broken::Entry)?,
            Err(ZipError::UnsupportedArchive(_)) => walk.skip(&name, SkipReason::UnsupportedCompression)?,
            Err(cause) => return Err(malformed(cause)),
        }
    }
    Ok(())
}
