//! The files of a folder and all folders in it.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use super::{Files, read_bounded};

pub(super) struct Folder {
    root: PathBuf,
    paths: Vec<PathBuf>,
    max_instance_bytes: u64,
}

impl Folder {
    /// All regular files below `root`, sorted. Links to folders are not followed: they may lead in
    /// circles.
    pub(super) fn walk(root: &Path, max_instance_bytes: u64) -> io::Result<Self> {
        let (mut folders, mut paths) = (vec![root.to_owned()], Vec::new());
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(&folder)? {
                let entry = entry?;
                if entry.file_type()?.is_dir() {
                    folders.push(entry.path());
                } else if entry.path().is_file() {
                    paths.push(entry.path());
                }
            }
        }
        paths.sort();
        Ok(Self { root: root.to_owned(), paths, max_instance_bytes })
    }

    /// One file.
    pub(super) fn single(path: &Path, max_instance_bytes: u64) -> Self {
        let root = path.parent().unwrap_or(path).to_owned();
        Self { root, paths: vec![path.to_owned()], max_instance_bytes }
    }
}

impl Files for Folder {
    fn len(&self) -> usize {
        self.paths.len()
    }

    fn name(&self, index: usize) -> String {
        let relative = |path: &PathBuf| path.strip_prefix(&self.root).unwrap_or(path).display().to_string();
        self.paths.get(index).map(relative).unwrap_or_default()
    }

    fn read(&self, index: usize) -> io::Result<Vec<u8>> {
        let path = self.paths.get(index).ok_or(io::ErrorKind::NotFound)?;
        read_bounded(File::open(path)?, self.max_instance_bytes, &path.display().to_string())
    }
}
