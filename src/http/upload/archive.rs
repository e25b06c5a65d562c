//! Zip, tar and gzip archives, walked entry by entry on a thread of its own. What they claim about
//! sizes and numbers is not believed: what comes out is counted.

use std::fs::File;
use std::io::{self, Read, Seek};

use bytes::Bytes;
use tokio::sync::mpsc::Sender;

use super::budget::Budget;
use super::sniff::{HEAD, Kind, kind, looks_like_dicom};
use crate::error::{Error, Result};
use crate::http::identity::Identity;
use crate::http::refused::SkipReason;

mod tar;
mod zip;

/// Bytes of one step.
const CHUNK: usize = 256 * 1024;

/// Names longer than this are cut where they are told.
const MAX_NAME: usize = 255;

/// What the walk finds, in order.
#[derive(Debug)]
pub(super) enum Step {
    /// An instance begins, with these bytes.
    Begin(String, Bytes),
    /// More of its bytes.
    Data(Bytes),
    /// It is whole.
    End,
    /// It can't be read to its end.
    Broken(String),
    /// A file that is no instance.
    Skipped(String, SkipReason),
}

/// Walks the archive and sends what it finds until it ends or nobody listens any more. Gives what
/// is left of the upload's budget.
///
/// # Errors
/// [`Error::MalformedUpload`], [`Error::ArchiveTooLarge`].
pub(super) fn walk(mut file: File, budget: Budget, steps: Sender<Step>) -> Result<Budget> {
    let head = head_of(&mut file)?;
    file.rewind()?;
    let mut walk = Walk { steps, budget };
    match kind(&head) {
        Kind::Zip => zip::walk(file, &mut walk)?,
        Kind::Tar => tar::walk(file, &mut walk)?,
        Kind::Gzip => {
            let mut unpacked = flate2::read::MultiGzDecoder::new(io::BufReader::new(file));
            let head = head_of(&mut unpacked).map_err(malformed)?;
            let inner = io::Cursor::new(head.clone()).chain(unpacked);
            match kind(&head) {
                Kind::Tar => tar::walk(inner, &mut walk)?,
                _ => walk.entry("", inner, Broken::Upload)?,
            }
        }
        Kind::Instance => walk.entry("", file, Broken::Upload)?,
    }
    Ok(walk.budget)
}

/// What an error while reading an entry spoils.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Broken {
    /// That entry alone (zip: each has its own place).
    Entry,
    /// All that follows (tar, gzip: one stream).
    Upload,
}

/// One walk through an archive.
struct Walk {
    steps: Sender<Step>,
    budget: Budget,
}

impl Walk {
    fn send(&self, step: Step) -> Result<()> {
        // The receiver is gone when the upload has failed already; that error is the one told.
        self.steps
            .blocking_send(step)
            .map_err(|_| Error::MalformedUpload("the upload was given up".to_owned()))
    }

    fn skip(&self, name: &str, reason: SkipReason) -> Result<()> {
        self.send(Step::Skipped(name.to_owned(), reason))
    }

    /// Sends one file, or why it is passed over.
    fn entry(&mut self, name: &str, mut content: impl Read, broken: Broken) -> Result<()> {
        let head = match head_of(&mut content) {
            Ok(head) => head,
            Err(cause) => return self.broken(name, cause, broken),
        };
        self.budget.unpacked(head.len() as u64)?;
        if let Some(reason) = passed_over(&head) {
            return self.skip(name, reason);
        }
        self.send(Step::Begin(name.to_owned(), head.into()))?;
        loop {
            let mut chunk = Vec::with_capacity(CHUNK);
            match content.by_ref().take(CHUNK as u64).read_to_end(&mut chunk) {
                Ok(0) => return self.send(Step::End),
                Ok(read) => {
                    self.budget.unpacked(read as u64)?;
                    self.send(Step::Data(chunk.into()))?;
                }
                Err(cause) => return self.broken(name, cause, broken),
            }
        }
    }

    fn broken(&self, name: &str, cause: io::Error, broken: Broken) -> Result<()> {
        match broken {
            Broken::Upload => Err(malformed(cause)),
            Broken::Entry => {
                // A head that can't be read has begun nothing yet.
                self.send(Step::Begin(name.to_owned(), Bytes::new()))?;
                self.send(Step::Broken(cause.to_string()))
            }
        }
    }
}

fn head_of(content: &mut impl Read) -> io::Result<Vec<u8>> {
    let mut head = Vec::with_capacity(HEAD);
    content.by_ref().take(HEAD as u64).read_to_end(&mut head)?;
    Ok(head)
}

/// Why a file that begins like this is no instance, if it is none.
pub(super) fn passed_over(head: &[u8]) -> Option<SkipReason> {
    if head.iter().all(|byte| *byte == 0) {
        Some(SkipReason::Empty)
    } else if Identity::of(head).is_media_directory() {
        Some(SkipReason::Dicomdir)
    } else if looks_like_dicom(head) {
        None
    } else {
        Some(SkipReason::NotDicom)
    }
}

/// A name as it can be told: valid text, no control characters, not too long.
pub(super) fn told(name: &[u8]) -> String {
    String::from_utf8_lossy(name).chars().filter(|c| !c.is_control()).take(MAX_NAME).collect()
}

fn malformed(cause: impl std::fmt::Display) -> Error {
    Error::MalformedUpload(cause.to_string())
}
