//! Where the walk gets its bytes from: a file that can be skipped over, or a deflated stream.

use std::io::{BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom};

use flate2::read::DeflateDecoder;

use super::ScanError;

/// Bytes in sequence. Nothing is allocated for what a length claims.
pub(crate) trait Input {
    /// Bytes consumed so far, counted from the beginning of the data set or file.
    fn position(&self) -> u64;
    /// Bytes left, where that is known before they are read.
    fn left(&self) -> Option<u64>;
    /// Fills `buffer`; ends too early: [`ScanError::Malformed`].
    fn fill(&mut self, buffer: &mut [u8]) -> Result<(), ScanError>;
    /// Passes over `count` bytes.
    fn skip(&mut self, count: u64) -> Result<(), ScanError>;
    /// Whether all bytes are consumed.
    fn at_end(&mut self) -> Result<bool, ScanError>;
    /// Copies bytes that come next without consuming them: as many as are at hand, at least one
    /// unless the end is reached. Returns how many.
    fn peek(&mut self, buffer: &mut [u8]) -> Result<usize, ScanError>;
}

fn truncated(position: u64) -> ScanError {
    ScanError::Malformed(format!("it ends in the middle of an element, after {position} bytes"))
}

/// A file, or bytes in memory.
pub(crate) struct Seekable<R> {
    reader: BufReader<R>,
    position: u64,
    end: u64,
}

impl<R: Read + Seek> Seekable<R> {
    /// Begins at byte `start` of `reader`.
    pub(crate) fn new(mut reader: R, start: u64) -> Result<Self, ScanError> {
        let end = reader.seek(SeekFrom::End(0))?;
        reader.seek(SeekFrom::Start(start))?;
        Ok(Self { reader: BufReader::new(reader), position: start, end })
    }

    /// The reader itself, to go on in another way.
    pub(crate) fn into_inner(self) -> R {
        self.reader.into_inner()
    }
}

impl<R: Read + Seek> Input for Seekable<R> {
    fn position(&self) -> u64 {
        self.position
    }

    fn left(&self) -> Option<u64> {
        Some(self.end.saturating_sub(self.position))
    }

    fn fill(&mut self, buffer: &mut [u8]) -> Result<(), ScanError> {
        self.reader.read_exact(buffer).map_err(|error| match error.kind() {
            ErrorKind::UnexpectedEof => truncated(self.position),
            _ => error.into(),
        })?;
        self.position += buffer.len() as u64;
        Ok(())
    }

    fn skip(&mut self, count: u64) -> Result<(), ScanError> {
        let offset = i64::try_from(count).ok().filter(|_| count <= self.end.saturating_sub(self.position));
        self.reader.seek_relative(offset.ok_or_else(|| truncated(self.position))?)?;
        self.position += count;
        Ok(())
    }

    fn at_end(&mut self) -> Result<bool, ScanError> {
        Ok(self.position >= self.end)
    }

    fn peek(&mut self, buffer: &mut [u8]) -> Result<usize, ScanError> {
        Ok(copy(self.reader.fill_buf()?, buffer))
    }
}

/// A deflated data set (PS3.5 section A.5), inflated piece by piece up to a limit.
pub(crate) struct Inflating<R> {
    reader: BufReader<DeflateDecoder<R>>,
    position: u64,
    limit: u64,
}

impl<R: Read> Inflating<R> {
    /// Inflates from where `reader` stands; more than `limit` bytes: [`ScanError::InflatesTooMuch`].
    pub(crate) fn new(reader: R, limit: u64) -> Self {
        Self { reader: BufReader::new(DeflateDecoder::new(reader)), position: 0, limit }
    }

    fn advance(&mut self, count: u64) -> Result<(), ScanError> {
        self.position = self.position.saturating_add(count);
        if self.position > self.limit {
            return Err(ScanError::InflatesTooMuch { limit_bytes: self.limit });
        }
        Ok(())
    }

    fn told(&self, error: std::io::Error) -> ScanError {
        match error.kind() {
            ErrorKind::UnexpectedEof => truncated(self.position),
            ErrorKind::InvalidInput | ErrorKind::InvalidData => {
                ScanError::Malformed("its deflated data set can't be inflated".into())
            }
            _ => error.into(),
        }
    }
}

impl<R: Read> Input for Inflating<R> {
    fn position(&self) -> u64 {
        self.position
    }

    fn left(&self) -> Option<u64> {
        None
    }

    fn fill(&mut self, buffer: &mut [u8]) -> Result<(), ScanError> {
        self.advance(buffer.len() as u64)?;
        self.reader.read_exact(buffer).map_err(|error| self.told(error))
    }

    fn skip(&mut self, count: u64) -> Result<(), ScanError> {
        // The limit is held against the claim: what claims more than the limit needs no reading.
        self.advance(count)?;
        let mut left = count;
        while left > 0 {
            let ready = self.reader.fill_buf();
            let ready = match ready {
                Ok(bytes) => bytes.len(),
                Err(error) => return Err(self.told(error)),
            };
            if ready == 0 {
                return Err(truncated(self.position));
            }
            let taken = usize::try_from(left).map_or(ready, |left| left.min(ready));
            self.reader.consume(taken);
            left -= taken as u64;
        }
        Ok(())
    }

    fn at_end(&mut self) -> Result<bool, ScanError> {
        match self.reader.fill_buf() {
            Ok(bytes) => Ok(bytes.is_empty()),
            Err(error) => Err(self.told(error)),
        }
    }

    fn peek(&mut self, buffer: &mut [u8]) -> Result<usize, ScanError> {
        match self.reader.fill_buf() {
            Ok(bytes) => Ok(copy(bytes, buffer)),
            Err(error) => Err(self.told(error)),
        }
    }
}

/// Copies what fits.
fn copy(from: &[u8], to: &mut [u8]) -> usize {
    let count = from.len().min(to.len());
    to[..count].copy_from_slice(&from[..count]);
    count
}
