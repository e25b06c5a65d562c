//! What both profiles give: clouds, figures and a decision on every slice, or why there is no cloud.

pub(crate) mod error;
pub(crate) mod figures;
pub(crate) mod reconstruction;
pub(crate) mod rejection;
pub(crate) mod slice_row;

pub use error::PipelineError;
pub use figures::Figures;
pub use reconstruction::{Contours, Reconstruction};
pub use rejection::{Reason, Rejection};
pub use slice_row::{Decision, SliceRow};
