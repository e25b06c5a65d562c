//! The hashes of a file's blocks, as they are stored beside it.

use std::io;

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

/// The version of the companion's form; a later one is refused.
const VERSION: u32 = 1;

/// SHA-256.
pub(super) type Hash = [u8; 32];

/// Length and block hashes of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Sums {
    pub(super) block_bytes: u32,
    pub(super) length: u64,
    blocks: Vec<Hash>,
}

/// As it is stored.
#[derive(Serialize, Deserialize)]
struct Stored {
    version: u32,
    block_bytes: u32,
    length: u64,
    /// SHA-256 of each block, hex.
    blocks: Vec<String>,
    /// SHA-256 over all of the above, hex: tells a damaged companion from a damaged file.
    sha256: String,
}

impl Sums {
    /// The hashes of `bytes`.
    pub(super) fn of(bytes: &[u8], block_bytes: u32) -> Self {
        let blocks = bytes.chunks(block_bytes as usize).map(|block| Sha256::digest(block).into()).collect();
        Self { block_bytes, length: bytes.len() as u64, blocks }
    }

    /// SHA-256 over length and hashes: names the file's bytes.
    pub(super) fn root(&self) -> Hash {
        let mut hash = Sha256::new();
        hash.update(VERSION.to_le_bytes());
        hash.update(self.block_bytes.to_le_bytes());
        hash.update(self.length.to_le_bytes());
        self.blocks.iter().for_each(|block| hash.update(block));
        hash.finalize().into()
    }

    /// Whether the bytes are those of that block.
    pub(super) fn holds(&self, block: u64, bytes: &[u8]) -> bool {
        let expected = usize::try_from(block).ok().and_then(|block| self.blocks.get(block));
        expected.is_some_and(|expected| Hash::from(Sha256::digest(bytes)) == *expected)
    }

    pub(super) fn to_json(&self) -> io::Result<Vec<u8>> {
        let stored = Stored {
            version: VERSION,
            block_bytes: self.block_bytes,
            length: self.length,
            blocks: self.blocks.iter().map(hex::encode).collect(),
            sha256: hex::encode(self.root()),
        };
        Ok(serde_json::to_vec(&stored)?)
    }

    /// Reads them back, or says what is wrong.
    pub(super) fn parse(json: &[u8]) -> Result<Self, &'static str> {
        #[derive(Deserialize)]
        struct Version {
            version: u32,
        }
        let no_json = "they are damaged";
        let Version { version } = serde_json::from_slice(json).map_err(|_| no_json)?;
        if version > VERSION {
            return Err("they are of a later version");
        }
        let stored: Stored = serde_json::from_slice(json).map_err(|_| no_json)?;
        let hash = |text: &String| hex::decode(text).ok().and_then(|bytes| Hash::try_from(bytes).ok());
        let blocks = stored.blocks.iter().map(hash).collect::<Option<Vec<_>>>().ok_or(no_json)?;
        let sums = Self { block_bytes: stored.block_bytes, length: stored.length, blocks };
        let whole = sums.block_bytes > 0
            && sums.length.div_ceil(u64::from(sums.block_bytes)) == sums.blocks.len() as u64
            && hash(&stored.sha256) == Some(sums.root());
        if whole { Ok(sums) } else { Err(no_json) }
    }
}
