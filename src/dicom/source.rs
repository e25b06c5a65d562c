//! Where the instances of a series are read from.

use std::io;
use std::path::PathBuf;

/// The Part 10 files of one series, in any order. Read by several threads at a time.
pub trait InstanceSource: Sync {
    /// The number of instances.
    fn len(&self) -> usize;
    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// The bytes of the instance at `index < len()`, as a DICOM Part 10 file (PS3.10 section 7).
    ///
    /// # Errors
    /// Whatever the storage says.
    fn read(&self, index: usize) -> io::Result<Vec<u8>>;
    /// The same, ended with [`io::ErrorKind::Interrupted`] once it is `stopped`: for sources that take a
    /// while for a large instance.
    ///
    /// # Errors
    /// As [`Self::read`].
    fn read_unless(&self, index: usize, _stopped: &dyn Fn() -> bool) -> io::Result<Vec<u8>> {
        self.read(index)
    }
    /// Bytes of the instance at `index`, where that is known before it is read.
    fn size(&self, _index: usize) -> Option<u64> {
        None
    }
}

/// Instances that are files.
#[derive(Debug, Clone)]
pub struct Files(pub Vec<PathBuf>);

impl InstanceSource for Files {
    fn len(&self) -> usize {
        self.0.len()
    }
    fn read(&self, index: usize) -> io::Result<Vec<u8>> {
        std::fs::read(&self.0[index])
    }
    fn size(&self, index: usize) -> Option<u64> {
        self.0.get(index)?.metadata().ok().map(|file| file.len())
    }
}
