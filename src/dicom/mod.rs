//! From bytes to a [`Volume`]: bounded scan, decoding, sorting, geometry, Hounsfield units.
//! No network and no catalog.
//!
//! Bytes from outside pass [`scan`] before anything parses them.

pub mod header;
pub mod source;
pub mod uid;
mod volume;

pub use volume::{SeriesIdentity, Volume};
