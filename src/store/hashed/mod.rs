//! Files of results with the hashes of their blocks, so that nothing of a damaged file is served
//! as if it were whole.
//!
//! Beside a file `triplanar.ply` lies `triplanar.ply.blocks`, written and made durable before it: its
//! length and the SHA-256 of each of its blocks, and a SHA-256 over these. A reader checks each block
//! before it gives out a byte of it. Results of release 0.1 have no such companions: they are read
//! without a check. A result of which some files have one and some lack it has lost it: damaged.

mod reader;
mod sums;

use std::io::{self, Write as _};

use super::blobs::{self, Blobs};

pub use reader::HashedFile;
use sums::Sums;

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

/// Stores `bytes` durably under `key`, with the hashes of its blocks.
pub(crate) fn put(blobs: &dyn Blobs, key: &str, bytes: &[u8]) -> io::Result<()> {
    let sums = Sums::of(bytes, BLOCK_BYTES);
    let mut file = blobs.temporary()?;
    file.write_all(&sums.to_json()?)?;
    blobs.adopt(file, &companion(key))?;
    blobs::put(blobs, key, bytes)
}

/// Removes a file and its companion.
#[cfg(test)]
pub(crate) fn remove(blobs: &dyn Blobs, key: &str) -> io::Result<()> {
    blobs.remove(&companion(key))?;
    blobs.remove(key)
}

/// Opens the file `name` of the result at `prefix`, of which `siblings` are all files that a result
/// can have. A file that is gone is [`Damage::Missing`].
pub(crate) fn open(
    blobs: &dyn Blobs,
    prefix: &str,
    name: &str,
    siblings: impl Iterator<Item = String>,
) -> io::Result<HashedFile> {
    let key = format!("{prefix}/{name}");
    let there = |key: &str| match blobs.open(key) {
        Ok(file) => Ok(Some(file)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    };
    let file = there(&key)?.ok_or_else(|| Damage::Missing(name.to_owned()))?;
    let sums = match blobs.read(&companion(&key)) {
        Ok(json) => Some(Sums::parse(&json).map_err(|why| Damage::Hashes { file: name.to_owned(), why })?),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            for sibling in siblings {
                if there(&companion(&format!("{prefix}/{sibling}")))?.is_some() {
                    return Err(Damage::Hashes { file: name.to_owned(), why: "they are missing" }.into());
                }
            }
            None
        }
        Err(error) => return Err(error),
    };
    HashedFile::new(file, name, sums)
}

#[cfg(test)]
mod tests;
