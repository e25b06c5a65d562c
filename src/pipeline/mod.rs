//! The triplanar pipeline of Cvetić et al. 2025 (Bioengineering 12(5), 498), one file a step.
//! Pure: values in, values out.

mod observer;
mod outcome;
pub mod parameters;
mod rejection;

pub use observer::{Observer, Silent, Stage};
pub use outcome::{Figures, PipelineError, Reconstruction, SliceRow};
pub use parameters::{Parameters, Profile};
pub use rejection::{Reason, Rejection};
