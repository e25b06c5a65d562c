//! Everything large: instances, clouds, reports. A blob is written once, whole, under a key of
//! its own, and never changed. The catalog alone knows which keys count.

mod aside;
mod files;

use std::fmt::Debug;
use std::io::{self, Read, Seek};

use tempfile::NamedTempFile;

pub(crate) use aside::Aside;
pub(crate) use files::{Files, keys_under};

/// The bytes of a blob, to be read piece by piece.
pub(crate) trait ReadBlob: Read + Seek + Debug + Send {}

impl ReadBlob for std::fs::File {}

/// Where blobs are kept. Synchronous: called from blocking threads. Keys are relative paths with
/// `/`, made by us, never by a sender.
pub(crate) trait Blobs: Debug + Send + Sync {
    /// A new file on the disk that [`Blobs::adopt`] takes from, removed when it is dropped.
    fn temporary(&self) -> io::Result<NamedTempFile>;
    /// Makes a finished temporary file durable under `key`: when this returns, bytes and name
    /// survive a power cut.
    fn adopt(&self, file: NamedTempFile, key: &str) -> io::Result<()>;
    /// The whole blob.
    fn read(&self, key: &str) -> io::Result<Vec<u8>>;
    /// The blob, to be read piece by piece.
    fn open(&self, key: &str) -> io::Result<Box<dyn ReadBlob>>;
    /// Removes a blob; one that isn't there is no error.
    fn remove(&self, key: &str) -> io::Result<()>;
    /// Removes every blob under a prefix of a result.
    fn remove_all(&self, prefix: &str) -> io::Result<()>;
    /// When it was last written, Unix ms.
    fn modified_ms(&self, key: &str) -> io::Result<i64>;
    /// Writes and removes a file in every kind of folder that files go to; the error names the folder.
    fn try_write(&self, bytes: &[u8]) -> io::Result<()>;
    /// Every key.
    fn keys(&self) -> io::Result<Vec<String>>;
}

/// Stores `bytes` durably under `key`.
pub(crate) fn put(blobs: &dyn Blobs, key: &str, bytes: &[u8]) -> io::Result<()> {
    use std::io::Write as _;
    let mut file = blobs.temporary()?;
    file.write_all(bytes)?;
    blobs.adopt(file, key)
}
