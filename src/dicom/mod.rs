//! From bytes to a [`Volume`]: bounded scan, decoding, sorting, geometry, Hounsfield units.
//! No network and no catalog.
//!
//! Bytes from outside pass [`scan`] before anything parses them.

pub mod ae_title;
mod dataset;
mod digest;
pub mod header;
pub mod identity;
pub mod part10;
mod pixel_extent;
pub mod pixels;
pub mod scan;
pub mod series;
pub mod sop_class;
pub mod source;
pub mod transfer_syntax;
pub mod uid;
mod volume;

pub use digest::content_digest;
pub(crate) use digest::{attributes_digest, content};
pub use pixel_extent::PixelExtentError;
pub use volume::{SeriesIdentity, Volume};
