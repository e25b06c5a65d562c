//! A file that collects the bytes of one instance as they arrive.

/// Bytes of one instance on their way to the store. Dropped, it removes its file.
#[derive(Debug)]
pub struct Spool {}
