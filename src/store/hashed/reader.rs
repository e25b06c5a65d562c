//! Reading a file block by block, each checked before a byte of it is given out.

use std::io::{self, BufRead, Read, Seek, SeekFrom};

use sha2::{Digest as _, Sha256};

use super::sums::Sums;
use super::{BLOCK_BYTES, Damage};
use crate::store::blobs::ReadBlob;

/// A stored file of a result. Holds one block in memory.
#[derive(Debug)]
pub struct HashedFile {
    file: Box<dyn ReadBlob>,
    name: String,
    length: u64,
    /// `None`: stored by release 0.1, without hashes.
    sums: Option<Sums>,
    /// The block at hand, and how much of it was given out.
    block: Vec<u8>,
    taken: usize,
    /// The block that comes next.
    next: u64,
}

impl HashedFile {
    pub(super) fn new(mut file: Box<dyn ReadBlob>, name: &str, sums: Option<Sums>) -> io::Result<Self> {
        let found = file.seek(SeekFrom::End(0))?;
        file.rewind()?;
        if let Some(sums) = sums.as_ref().filter(|sums| sums.length != found) {
            return Err(Damage::Length { file: name.to_owned(), found, length: sums.length }.into());
        }
        let name = name.to_owned();
        Ok(Self { file, name, length: found, sums, block: Vec::new(), taken: 0, next: 0 })
    }

    /// Bytes of the whole.
    #[must_use]
    pub fn length(&self) -> u64 {
        self.length
    }

    /// A hash that names the bytes of the whole. Reads all of a file that was stored without hashes.
    ///
    /// # Errors
    /// Those of reading.
    pub fn identity(&mut self) -> io::Result<[u8; 32]> {
        if let Some(sums) = &self.sums {
            return Ok(sums.root());
        }
        let mut hash = Sha256::new();
        self.go_to(0)?;
        while let Some(block) = self.block()? {
            hash.update(block);
        }
        self.go_to(0)?;
        Ok(hash.finalize().into())
    }

    /// Goes on at that byte.
    ///
    /// # Errors
    /// Those of reading.
    pub fn go_to(&mut self, position: u64) -> io::Result<()> {
        let size = self.block_bytes();
        (self.next, self.taken) = (position / size, 0);
        self.block.clear();
        self.file.seek(SeekFrom::Start(self.next * size))?;
        if !position.is_multiple_of(size) && self.load()? {
            // Less than a block, so it is a usize.
            self.taken = usize::try_from(position % size).unwrap_or(usize::MAX).min(self.block.len());
        }
        Ok(())
    }

    /// What is left of the block at hand, or else the next one; `None` at the end.
    ///
    /// # Errors
    /// A block that is damaged (`Damage`), and those of reading.
    pub fn block(&mut self) -> io::Result<Option<&[u8]>> {
        if self.taken >= self.block.len() && !self.load()? {
            return Ok(None);
        }
        let from = std::mem::replace(&mut self.taken, self.block.len());
        Ok(Some(&self.block[from..]))
    }

    /// All of it.
    pub(crate) fn whole(mut self) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.go_to(0)?;
        while let Some(block) = self.block()? {
            bytes.extend_from_slice(block);
        }
        Ok(bytes)
    }

    /// Reads it to its end, for its damage alone.
    pub(crate) fn check(mut self) -> io::Result<()> {
        self.go_to(0)?;
        while self.block()?.is_some() {}
        Ok(())
    }

    fn block_bytes(&self) -> u64 {
        u64::from(self.sums.as_ref().map_or(BLOCK_BYTES, |sums| sums.block_bytes))
    }

    /// Reads and checks the next block; false at the end.
    fn load(&mut self) -> io::Result<bool> {
        let size = self.block_bytes();
        let left = self.length.saturating_sub(self.next.saturating_mul(size));
        (self.taken, self.block) = (0, std::mem::take(&mut self.block));
        self.block.clear();
        if left == 0 {
            return Ok(false);
        }
        let wanted = left.min(size);
        (&mut self.file).take(wanted).read_to_end(&mut self.block)?;
        let number = self.next;
        let whole = self.block.len() as u64 == wanted;
        let as_written = self.sums.as_ref().is_none_or(|sums| sums.holds(number, &self.block));
        if !whole || !as_written {
            self.block.clear();
            return Err(Damage::Block { file: self.name.clone(), block: number }.into());
        }
        self.next += 1;
        Ok(true)
    }
}

impl Read for HashedFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let ready = self.fill_buf()?;
        let count = ready.len().min(buffer.len());
        buffer[..count].copy_from_slice(&ready[..count]);
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for HashedFile {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.taken >= self.block.len() {
            self.load()?;
        }
        Ok(&self.block[self.taken.min(self.block.len())..])
    }

    fn consume(&mut self, count: usize) {
        self.taken += count;
    }
}
