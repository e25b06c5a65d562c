//! `set-aside/`: blobs without a row that could not get one, kept for a while under their former
//! path, for a person to look at.

use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use super::files::{keys_under, sync_folder};

const SET_ASIDE: &str = "set-aside";

/// The folder.
#[derive(Debug, Clone)]
pub(crate) struct Aside {
    root: PathBuf,
}

/// What is in it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Kept {
    pub(crate) files: u64,
    pub(crate) bytes: u64,
}

impl Aside {
    /// That of a data directory.
    pub(crate) fn of(root: &Path) -> Self {
        Self { root: root.to_owned() }
    }

    /// Moves a file of the data directory there, under the same path.
    pub(crate) fn take(&self, key: &str) -> io::Result<()> {
        self.take_as(key, key)
    }

    /// Moves a file of the data directory there, under another path.
    pub(crate) fn take_as(&self, key: &str, name: &str) -> io::Result<()> {
        let (from, to) = (self.root.join(key), self.root.join(SET_ASIDE).join(name));
        let folder = to.parent().unwrap_or(&self.root);
        fs::create_dir_all(folder)?;
        fs::rename(&from, &to)?;
        sync_folder(folder)?;
        // Its folder goes too if it was a result's and is empty now.
        let results = self.root.join("results");
        for folder in from.ancestors().skip(1).take_while(|f| f.starts_with(&results) && **f != results) {
            if fs::remove_dir(folder).is_err() {
                break;
            }
        }
        Ok(())
    }

    /// What is in it.
    pub(crate) fn kept(&self) -> io::Result<Kept> {
        let mut kept = Kept::default();
        for key in keys_under(&self.root, vec![self.root.join(SET_ASIDE)])? {
            kept.files += 1;
            kept.bytes += fs::metadata(self.root.join(key))?.len();
        }
        Ok(kept)
    }

    /// Removes what was set aside longer ago than `max_age_s`, and the oldest beyond `max_bytes`.
    /// Gives what is left, and how many files went.
    pub(crate) fn bound(&self, now_s: i64, max_age_s: i64, max_bytes: u64) -> io::Result<(Kept, u64)> {
        let mut files = Vec::new();
        for key in keys_under(&self.root, vec![self.root.join(SET_ASIDE)])? {
            let path = self.root.join(key);
            let metadata = fs::metadata(&path)?;
            // A rename changes this time, and not that of the content.
            files.push((metadata.ctime(), metadata.len(), path));
        }
        // Newest first.
        files.sort_unstable_by(|a, b| b.cmp(a));
        let (mut kept, mut removed) = (Kept::default(), 0);
        for (since, size, path) in files {
            if now_s.saturating_sub(since) > max_age_s || kept.bytes.saturating_add(size) > max_bytes {
                fs::remove_file(path)?;
                removed += 1;
            } else {
                kept.files += 1;
                kept.bytes += size;
            }
        }
        Ok((kept, removed))
    }
}
