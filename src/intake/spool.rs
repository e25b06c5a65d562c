//! A file that collects the bytes of one instance as they arrive.

use crate::error::Result;

/// Bytes of one instance on their way to the store. Dropped, it removes its file.
#[derive(Debug)]
pub struct Spool {}

#[expect(unused_variables, clippy::unused_async, reason = "the bodies follow")]
impl Spool {
    /// Appends.
    ///
    /// # Errors
    /// Beyond the limit of one instance; a full disk. The spool is of no use after either.
    pub async fn write(&mut self, bytes: &[u8]) -> Result<()> {
        todo!()
    }
}
