//! Tar archives, as they come, without going back.

use std::cell::Cell;
use std::io::Read;
use std::rc::Rc;

use tar::{Archive, EntryType};

use super::{Broken, Walk, malformed, told};
use crate::error::Result;
use crate::http::upload::budget::Budget;

/// Of a long name in an entry of its own (GNU `L`), so much is read.
const LONG_NAME: u64 = 4096;

pub(super) fn walk(content: impl Read, walk: &mut Walk) -> Result<()> {
    let whole = walk.budget;
    let passed = Rc::new(Cell::new(0));
    let walked = entries(Metered { content, budget: whole, passed: Rc::clone(&passed) }, walk);
    whole.check_unpacked(passed.get())?;
    walked?;
    // Headers and what was passed over have been unpacked too.
    walk.budget.unpacked_since(&whole, passed.get())
}

fn entries(content: impl Read, walk: &mut Walk) -> Result<()> {
    let mut archive = Archive::new(content);
    let mut long_name = None;
    // Raw: the library would read a name of any claimed length into memory.
    for entry in archive.entries().map_err(malformed)?.raw(true) {
        let mut entry = entry.map_err(malformed)?;
        walk.budget.entry()?;
        match entry.header().entry_type() {
            EntryType::GNULongName => {
                let mut name = Vec::new();
                entry.by_ref().take(LONG_NAME).read_to_end(&mut name).map_err(malformed)?;
                long_name = Some(told(&name));
            }
            EntryType::Regular | EntryType::Continuous => {
                let name = long_name.take().unwrap_or_else(|| told(&entry.header().path_bytes()));
                let size = entry.header().entry_size().map_err(malformed)?;
                let mut content = Whole { content: entry, missing: size };
                walk.entry(&name, &mut content, Broken::Upload)?;
            }
            _ => {}
        }
    }
    Ok(())
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
}

impl<R: Read> Read for Metered<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let read = self.content.read(buffer)?;
        self.passed.set(self.passed.get() + read as u64);
        self.budget.check_unpacked(self.passed.get()).map_err(std::io::Error::other)?;
        Ok(read)
    }
}
