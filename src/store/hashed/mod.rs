//! Files of results with the hashes of their blocks, so that nothing of a damaged file is served
//! as if it were whole.
//!
//! Beside a file `triplanar.ply` lies `triplanar.ply.blocks`, written and made durable before it: its
//! length and the SHA-256 of each of its blocks, and a SHA-256 over these. A reader checks each block
//! before it gives out a byte of it. The last hash, by the file's name, also stands in the row of the
//! reconstruction and in the record beside the files ([`Seal`]): a file is what was written under that
//! name for that reconstruction, or damaged. Results of release 0.1 have neither; their rows say so: they
//! are read without a check.

mod reader;
mod seal;
mod sums;

use std::io::{self, Write as _};

use super::blobs::{self, Blobs, ReadBlob};

pub use reader::HashedFile;
pub(crate) use seal::Seal;
use sums::{Hash, Sums};

/// Bytes of a block: what a reader holds at a time.
const BLOCK_BYTES: u32 = 1 << 16;

/// The key of the companion of a file.
fn companion(key: &str) -> String {
    format!("{key}.blocks")
}

/// Why a file of a result can't be given out. Travels inside an [`io::Error`].
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Damage {
    /// The file is gone.
    #[error("the file {0} is missing")]
    Missing(String),
    /// Its length is another one.
    #[error("the file {file} holds {found} bytes, not {length}")]
    Length {
        /// Name within the result.
        file: String,
        /// Bytes that are there.
        found: u64,
        /// Bytes that were written.
        length: u64,
    },
    /// The bytes of a block are others.
    #[error("block {block} of the file {file} does not have the bytes that were written")]
    Block {
        /// Name within the result.
        file: String,
        /// Number of the block, from 0.
        block: u64,
    },
    /// It is a file of another name or result, or its hashes are.
    #[error("the file {0} is not the one that was written for this result")]
    Foreign(String),
    /// The hashes themselves are damaged, gone, or of a later version.
    #[error("the block hashes of the file {file} can't be used: {why}")]
    Hashes {
        /// Name within the result.
        file: String,
        /// What is wrong with them.
        why: &'static str,
    },
}

impl Damage {
    /// The damage that an error of a read tells of, if it does.
    pub(crate) fn of(error: &io::Error) -> Option<&Self> {
        error.get_ref()?.downcast_ref()
    }
}

impl From<Damage> for io::Error {
    fn from(damage: Damage) -> Self {
        Self::new(io::ErrorKind::InvalidData, damage)
    }
}

/// Stores `bytes` durably under `key`, with the hashes of its blocks; gives the hash over these.
pub(crate) fn put(blobs: &dyn Blobs, key: &str, bytes: &[u8]) -> io::Result<Hash> {
    let sums = Sums::of(bytes, BLOCK_BYTES);
    let mut file = blobs.temporary()?;
    file.write_all(&sums.to_json()?)?;
    blobs.adopt(file, &companion(key))?;
    blobs::put(blobs, key, bytes)?;
    Ok(sums.root())
}

/// Removes a file and its companion.
pub(crate) fn remove(blobs: &dyn Blobs, key: &str) -> io::Result<()> {
    blobs.remove(&companion(key))?;
    blobs.remove(key)
}

/// Opens the file `name` of the result at `prefix`. `seal` is that of its row; `None`: a result of release
/// 0.1. A file that is gone is [`Damage::Missing`].
pub(crate) fn open(
    blobs: &dyn Blobs,
    prefix: &str,
    name: &str,
    seal: Option<&Seal>,
) -> io::Result<HashedFile> {
    let file = file(blobs, prefix, name)?;
    let Some(seal) = seal else { return HashedFile::new(file, name, None) };
    let sums = sums(blobs, prefix, name)?;
    if seal.of(name) != Some(&sums.root()) {
        return Err(Damage::Foreign(name.to_owned()).into());
    }
    HashedFile::new(file, name, Some(sums))
}

/// Opens a file that is tied to no row: what was written with the hashes that lie beside it.
pub(crate) fn open_untied(blobs: &dyn Blobs, prefix: &str, name: &str) -> io::Result<HashedFile> {
    let file = file(blobs, prefix, name)?;
    HashedFile::new(file, name, Some(sums(blobs, prefix, name)?))
}

fn file(blobs: &dyn Blobs, prefix: &str, name: &str) -> io::Result<Box<dyn ReadBlob>> {
    match blobs.open(&format!("{prefix}/{name}")) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Err(Damage::Missing(name.to_owned()).into()),
        opened => opened,
    }
}

fn sums(blobs: &dyn Blobs, prefix: &str, name: &str) -> io::Result<Sums> {
    let damaged = |why| Damage::Hashes { file: name.to_owned(), why }.into();
    match blobs.read(&companion(&format!("{prefix}/{name}"))) {
        Ok(json) => Sums::parse(&json).map_err(damaged),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Err(damaged("they are missing")),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests;
