//! The shared series, read from their zips without touching the disk.

use std::io;
use std::path::Path;

use triplanar::dicom::Volume;
use triplanar::dicom::series::{ReadLimits, read};
use triplanar::dicom::source::InstanceSource;
use triplanar::observer::Silent;

use super::data;

/// Instances in memory.
#[derive(Debug, Clone)]
pub(crate) struct InMemory(pub(crate) Vec<Vec<u8>>);

impl InstanceSource for InMemory {
    fn len(&self) -> usize {
        self.0.len()
    }
    fn read(&self, index: usize) -> io::Result<Vec<u8>> {
        Ok(self.0[index].clone())
    }
}

/// The volume of `series/<name>.zip`.
pub(crate) fn volume(data: &Path, name: &str) -> Volume {
    let mut files = data::series(data, name, "");
    // A media directory (PS3.10 section 8) beside the instances.
    files.retain(|(path, _)| path != "DIRFILE");
    let instances = InMemory(files.into_iter().map(|(_, bytes)| bytes).collect());
    let (volume, _) = read(&instances, &ReadLimits::default(), &Silent)
        .unwrap_or_else(|e| panic!("{name}: {} ({})", e, e.code()));
    volume
}
