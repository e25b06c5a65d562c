//! The point cloud and the formats in which it leaves.
//!
//! A new format is one file in `cloud/formats/` and one line in its table ([`Format`]).

mod formats;
mod max_error;
mod metadata;
mod point_cloud;

pub(crate) use formats::encode_asking;
pub use formats::{Conversion, ConversionError, Converting, Format, UnknownFormat, encode, ply};
pub use max_error::{InvalidMaxError, MaxError, Unfiltered};
pub use metadata::Metadata;
pub use point_cloud::{NoErrors, PointCloud};
