//! Tar archives, as they come, without going back.

use std::cell::Cell;
use std::io::Read;
use std::rc::Rc;

use tar::{Archive, EntryType};

use super::{Broken, CHUNK, Walk, malformed, told};
use crate::error::Result;
use crate::http::upload::budget::Budget;

/// Of a long name in an entry of its own (GNU `L`), so much is read.
const LONG_NAME: u64 = 4096;

/// Bytes of a block.
const BLOCK: u64 = 512;

/// Bytes of a record by default (POSIX.1-2017, pax, `-b`), of GNU tar and bsdtar too.
const USUAL_RECORD: u64 = 10_240;

/// Records of tapes.
const RECORDS: [u64; 6] = [32_768, 65_536, 131_072, 262_144, 524_288, 1_048_576];

pub(super) fn walk(content: impl Read, walk: &mut Walk) -> Result<()> {
    let whole = walk.budget;
    let passed = Rc::new(Cell::new(0));
    let mut metered = Metered { content, budget: whole, passed: Rc::clone(&passed), zeros: 0 };
    let walked = entries(&mut metered, walk).and_then(|end| check_end(&mut metered, end));
    whole.check_unpacked(passed.get())?;
    walked?;
    // Headers and what was passed over have been unpacked too.
    walk.budget.unpacked_since(&whole, passed.get())
}

/// Gives the place behind the last entry.
fn entries(content: impl Read, walk: &mut Walk) -> Result<u64> {
    let mut archive = Archive::new(content);
    let mut long_name = None;
    let mut end = 0;
    // Raw: the library would read a name of any claimed length into memory.
    for entry in archive.entries().map_err(malformed)?.raw(true) {
        let mut entry = entry.map_err(malformed)?;
        walk.budget.entry()?;
        let size = entry.header().entry_size().map_err(malformed)?;
        let padded = size.checked_next_multiple_of(BLOCK);
        let behind = padded.and_then(|padded| padded.checked_add(entry.raw_file_position()));
        end = behind.ok_or_else(|| malformed("an entry is larger than any archive"))?;
        match entry.header().entry_type() {
            EntryType::GNULongName => {
                let mut name = Vec::new();
                entry.by_ref().take(LONG_NAME).read_to_end(&mut name).map_err(malformed)?;
                long_name = Some(told(&name));
            }
            EntryType::Regular | EntryType::Continuous => {
                let name = long_name.take().unwrap_or_else(|| told(&entry.header().path_bytes()));
                let mut content = Whole { content: entry, missing: size };
                walk.entry(&name, &mut content, Broken::Upload)?;
            }
            _ => {}
        }
    }
    Ok(end)
}

/// Two blocks of zeros end an archive (POSIX.1-2017, pax, ustar interchange format), and more zeros fill
/// up its last record. Whatever else is behind the last entry, the archive is not whole: a copy that was
/// cut at an entry, one of which the rest was left as zeros, one that lost a header.
fn check_end(content: &mut Metered<impl Read>, end: u64) -> Result<()> {
    let mut chunk = vec![0; CHUNK];
    loop {
        match content.read(&mut chunk) {
            Ok(0) => break,
            Ok(_) => {}
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Err(malformed(error)),
        }
    }
    let length = content.passed.get();
    let tail = length.saturating_sub(end);
    if tail < 2 * BLOCK {
        return Err(malformed("the tar archive breaks off: the two blocks of zeros at its end are missing"));
    }
    if content.zeros < tail {
        return Err(malformed("the tar archive is damaged: something follows a block of zeros"));
    }
    // The record is the smallest that explains the padding and fits into the archive.
    let fills_a_record = |record: u64| length.is_multiple_of(record) && tail < record + 2 * BLOCK;
    if tail < USUAL_RECORD + 2 * BLOCK || RECORDS.iter().any(|record| fills_a_record(*record)) {
        return Ok(());
    }
    Err(malformed("the tar archive breaks off: it ends with more zeros than fill up a record"))
}

/// Tells a file that breaks off from one that ends.
struct Whole<R> {
    content: R,
    missing: u64,
}

impl<R: Read> Read for Whole<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let read = self.content.read(buffer)?;
        self.missing = self.missing.saturating_sub(read as u64);
        if read == 0 && self.missing > 0 && !buffer.is_empty() {
            return Err(std::io::Error::new(std::io::ErrorKind::UnexpectedEof, "the archive breaks off"));
        }
        Ok(read)
    }
}

/// Ends a stream that unpacks to more than it may, what is passed over included.
struct Metered<R> {
    content: R,
    budget: Budget,
    passed: Rc<Cell<u64>>,
    /// Zeros at the end of what passed.
    zeros: u64,
}

impl<R: Read> Read for Metered<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let read = self.content.read(buffer)?;
        self.passed.set(self.passed.get() + read as u64);
        let bytes = buffer.get(..read).unwrap_or_default();
        match bytes.iter().rposition(|byte| *byte != 0) {
            Some(last) => self.zeros = (read - 1 - last) as u64,
            None => self.zeros += read as u64,
        }
        self.budget.check_unpacked(self.passed.get()).map_err(std::io::Error::other)?;
        Ok(read)
    }
}
