//! Blobs as files under one folder: `instances/<two hex digits>/…`, `results/<id>/<fence>/…`, and
//! `incoming/` for what is not whole yet.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::{Blobs, ReadBlob};

/// Files are collected here before they are renamed to their key, on the same file system.
const INCOMING: &str = "incoming";
/// What `fsck` makes at the top of a file system, which may be mounted on a folder of blobs.
const LOST_AND_FOUND: &str = "lost+found";
/// The folders that hold blobs.
const FOLDERS: [&str; 2] = [INSTANCES, "results"];
/// The folder of the instances, with one folder in it for each value of the first two hex digits.
const INSTANCES: &str = "instances";

/// Blobs as files.
#[derive(Debug)]
pub(crate) struct Files {
    root: PathBuf,
}

impl Files {
    /// Makes the folders that are missing and removes what was being written when a former
    /// process died.
    pub(crate) fn open(root: &Path) -> io::Result<Self> {
        let files = Self { root: root.to_owned() };
        for folder in FOLDERS {
            files.make_folder(&root.join(folder))?;
        }
        files.make_shards(&root.join(INSTANCES))?;
        let incoming = files.incoming();
        if incoming.exists() {
            fs::remove_dir_all(&incoming)?;
        }
        files.make_folder(&incoming)?;
        Ok(files)
    }

    /// To be read: nothing is made or removed.
    pub(crate) fn at(root: &Path) -> Self {
        Self { root: root.to_owned() }
    }

    /// The folder of unfinished files.
    pub(crate) fn incoming(&self) -> PathBuf {
        self.root.join(INCOMING)
    }

    /// Makes all folders that instances go to, durably, before the first one comes: two that
    /// arrive at a time can't rely on a folder that the other has made and not yet synced.
    fn make_shards(&self, instances: &Path) -> io::Result<()> {
        for shard in 0..=u8::MAX {
            create_folder(&instances.join(format!("{shard:02x}")))?;
        }
        sync_folder(instances)
    }

    /// Makes a folder durably, and those above it up to the root. One that is there already is
    /// synced all the same: who made it may not have come to that.
    fn make_folder(&self, folder: &Path) -> io::Result<()> {
        if folder == self.root {
            return Ok(());
        }
        if let Some(parent) = folder.parent().filter(|parent| parent.starts_with(&self.root)) {
            self.make_folder(parent)?;
        }
        create_folder(folder)?;
        folder.parent().map_or(Ok(()), sync_folder)
    }
}

impl Blobs for Files {
    fn temporary(&self) -> io::Result<NamedTempFile> {
        NamedTempFile::new_in(self.incoming())
    }

    fn adopt(&self, file: NamedTempFile, key: &str) -> io::Result<()> {
        let path = self.root.join(key);
        let folder = path.parent().unwrap_or(&self.root);
        if !folder.starts_with(self.root.join(INSTANCES)) {
            self.make_folder(folder)?;
        }
        file.as_file().sync_all()?;
        file.persist(&path).map_err(|error| error.error)?;
        sync_folder(folder)
    }

    fn read(&self, key: &str) -> io::Result<Vec<u8>> {
        let path = self.root.join(key);
        fs::read(&path).map_err(|error| named(&path, error))
    }

    fn open(&self, key: &str) -> io::Result<Box<dyn ReadBlob>> {
        let path = self.root.join(key);
        Ok(Box::new(File::open(&path).map_err(|error| named(&path, error))?))
    }

    fn remove(&self, key: &str) -> io::Result<()> {
        let path = self.root.join(key);
        match fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        // Folders of a result go with their last file; `remove_dir` leaves one that is in use.
        let results = self.root.join("results");
        for folder in path.ancestors().skip(1).take_while(|f| f.starts_with(&results) && **f != results) {
            if fs::remove_dir(folder).is_err() {
                break;
            }
        }
        Ok(())
    }

    fn remove_all(&self, prefix: &str) -> io::Result<()> {
        for key in keys_under(&self.root, vec![self.root.join(prefix)])? {
            self.remove(&key)?;
        }
        Ok(())
    }

    fn modified_ms(&self, key: &str) -> io::Result<i64> {
        let modified = fs::metadata(self.root.join(key))?.modified()?;
        let since = modified.duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
        Ok(i64::try_from(since.as_millis()).unwrap_or(i64::MAX))
    }

    fn try_write(&self, bytes: &[u8]) -> io::Result<()> {
        let shards = (0..=u8::MAX).map(|shard| format!("{INSTANCES}/{shard:02x}"));
        for folder in shards {
            rustix::fs::access(self.root.join(&folder), rustix::fs::Access::WRITE_OK)
                .map_err(|error| named(Path::new(&folder), error.into()))?;
        }
        for folder in [INCOMING, "results", "instances/00"] {
            tempfile::tempfile_in(self.root.join(folder))
                .and_then(|mut file| file.write_all(bytes))
                .map_err(|error| named(Path::new(folder), error))?;
        }
        Ok(())
    }

    fn keys(&self) -> io::Result<Vec<String>> {
        keys_under(&self.root, FOLDERS.iter().map(|folder| self.root.join(folder)).collect())
    }
}

/// The files in the folders and below, relative to `root`, in order; a folder that is not there
/// has none.
pub(crate) fn keys_under(root: &Path, mut folders: Vec<PathBuf>) -> io::Result<Vec<String>> {
    let mut keys = Vec::new();
    while let Some(folder) = folders.pop() {
        let entries = match fs::read_dir(&folder) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
            entries => entries.map_err(|error| named(&folder, error))?,
        };
        for entry in entries {
            let entry = entry.map_err(|error| named(&folder, error))?;
            if entry.file_name() == LOST_AND_FOUND {
                continue;
            }
            let path = entry.path();
            let kind = entry.file_type().map_err(|error| named(&path, error))?;
            // A folder may be a link to one on another disk.
            if kind.is_dir() || kind.is_symlink() && path.is_dir() {
                folders.push(path);
            } else if let Some(key) = entry.path().strip_prefix(root).ok().and_then(Path::to_str) {
                keys.push(key.to_owned());
            }
        }
    }
    keys.sort_unstable();
    Ok(keys)
}

/// The error with the path that it is about; its kind stays, but for shortages, which are told by
/// their number.
pub(super) fn named(path: &Path, error: io::Error) -> io::Error {
    match error.kind() {
        io::ErrorKind::PermissionDenied
        | io::ErrorKind::ReadOnlyFilesystem
        | io::ErrorKind::NotFound
        | io::ErrorKind::NotADirectory
        | io::ErrorKind::IsADirectory => io::Error::new(error.kind(), format!("{}: {error}", path.display())),
        _ => error,
    }
}

/// Makes a folder if it is not there.
fn create_folder(folder: &Path) -> io::Result<()> {
    match fs::create_dir(folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => Err(named(folder, error)),
        Err(_) if !folder.is_dir() => Err(named(folder, io::ErrorKind::NotADirectory.into())),
        _ => Ok(()),
    }
}

/// Makes the names in `folder` durable.
pub(super) fn sync_folder(folder: &Path) -> io::Result<()> {
    File::open(folder).and_then(|opened| opened.sync_all()).map_err(|error| named(folder, error))
}

#[cfg(test)]
mod tests {
    use super::super::put;
    use super::*;

    #[test]
    fn a_blob_is_there_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let files = Files::open(dir.path()).unwrap();
        put(&files, "results/a/1/report.json", b"{}").unwrap();
        drop(files.temporary().unwrap());
        assert_eq!(files.read("results/a/1/report.json").unwrap(), b"{}");
        assert_eq!(files.keys().unwrap(), ["results/a/1/report.json"]);
        assert_eq!(fs::read_dir(files.incoming()).unwrap().count(), 0);
    }

    #[test]
    fn removing_the_last_file_of_a_result_removes_its_folders() {
        let dir = tempfile::tempdir().unwrap();
        let files = Files::open(dir.path()).unwrap();
        put(&files, "results/a/1/report.json", b"{}").unwrap();
        files.remove("results/a/1/report.json").unwrap();
        files.remove("results/a/1/report.json").unwrap();
        assert!(!dir.path().join("results/a").exists());
        assert!(dir.path().join("results").exists());
    }

    #[test]
    fn what_was_being_written_when_the_process_died_is_removed_at_start() {
        let dir = tempfile::tempdir().unwrap();
        let files = Files::open(dir.path()).unwrap();
        fs::write(files.incoming().join("left"), b"x").unwrap();
        drop(Files::open(dir.path()).unwrap());
        assert_eq!(fs::read_dir(files.incoming()).unwrap().count(), 0);
    }
}
