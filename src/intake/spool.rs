//! Collects the bytes of one instance as they arrive: the first ones in memory, all of them in an
//! unnamed file when they are more.

use std::fs::File;
use std::io::{Cursor, Read, Seek, SeekFrom, Write as _};
use std::sync::{Arc, Mutex, PoisonError};

use crate::dicom::scan::{self, Encoding, Limits};
use crate::dicom::uid::{SeriesInstanceUid, SopInstanceUid};
use crate::error::{Error, Result};
use crate::store::{Store, blocking};

/// Bytes kept in memory, and written at a time: a CT slice fits, so most instances are written to
/// the disk once.
const IN_MEMORY: usize = 1 << 20;

/// The first bytes of an instance tell its series, which stands in group 0020.
const BEGINNING: usize = 1 << 16;

/// The first bytes of an instance on its way: whose it is, if the rest does not come.
#[derive(Debug, Clone, Default)]
pub(crate) struct Beginning(Arc<Mutex<Vec<u8>>>);

impl Beginning {
    fn extend(&self, bytes: &[u8]) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let room = BEGINNING - all.len();
        all.extend_from_slice(&bytes[..bytes.len().min(room)]);
    }

    /// The series and the instance, as far as the bytes tell them.
    pub(super) fn identity(
        &self,
        encoding: &Encoding,
        limits: &Limits,
    ) -> Option<(SeriesInstanceUid, SopInstanceUid)> {
        let bytes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        scan::identify(Cursor::new(&**bytes), encoding, limits)
    }
}

/// Bytes that can be read again from their beginning.
pub(super) trait Reader: Read + Seek + Send {}
impl<T: Read + Seek + Send> Reader for T {}

/// Bytes of one instance on their way to the store. Dropped, it leaves nothing.
#[derive(Debug)]
pub struct Spool {
    store: Store,
    limit: u64,
    length: u64,
    pending: Vec<u8>,
    /// Without a name: it is gone with its handle, however this process ends.
    file: Option<File>,
    beginning: Beginning,
}

impl Spool {
    pub(super) fn new(store: Store, limit: u64) -> Self {
        Self { store, limit, length: 0, pending: Vec::new(), file: None, beginning: Beginning::default() }
    }

    /// The first bytes, which stay when the spool is dropped.
    pub(crate) fn beginning(&self) -> Beginning {
        self.beginning.clone()
    }

    /// Appends.
    ///
    /// # Errors
    /// Beyond the limit of one instance; a full disk. The spool is of no use after either.
    pub async fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.length += bytes.len() as u64;
        if self.length > self.limit {
            return Err(Error::TooLarge { limit_bytes: self.limit, setting: "intake.max_instance_bytes" });
        }
        self.beginning.extend(bytes);
        self.pending.extend_from_slice(bytes);
        if self.pending.len() > IN_MEMORY { self.flush().await } else { Ok(()) }
    }

    async fn flush(&mut self) -> Result<()> {
        self.store.check_room(self.pending.len() as u64)?;
        let (file, mut pending) = (self.file.take(), std::mem::take(&mut self.pending));
        let incoming = self.store.incoming().to_owned();
        let (file, pending) = blocking(move || {
            let mut file = match file {
                Some(file) => file,
                None => tempfile::tempfile_in(incoming)?,
            };
            file.write_all(&pending)?;
            pending.clear();
            Ok((file, pending))
        })
        .await?;
        self.file = Some(file);
        self.pending = pending;
        Ok(())
    }

    /// All bytes, from their beginning.
    pub(super) async fn finish(mut self) -> Result<Box<dyn Reader>> {
        if self.file.is_none() {
            return Ok(Box::new(Cursor::new(self.pending)));
        }
        self.flush().await?;
        let mut file = self.file.take().ok_or_else(|| Error::internal("the spool lost its file"))?;
        file.seek(SeekFrom::Start(0))?;
        Ok(Box::new(file))
    }
}
