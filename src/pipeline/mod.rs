//! The triplanar pipeline, in two profiles. Pure: values in, values out. [`reconstruct()`] runs the
//! profile that the parameters name.
//!
//! | folder | what it holds |
//! |---|---|
//! | [`parameters`] | what a reconstruction can be asked for |
//! | [`paper`] | the published algorithm, one file a step |
//! | [`precise`] | the whole skin in its true place, in five stages |
//! | [`result`] | what both give: clouds, figures, a decision on every slice |
//! | [`neighbours`] | searches among points, and what they may cost |
//! | [`slices`] | a volume is cut into slices along three planes (paper, section 2.1) |
//! | [`picture()`] | a slice with its contour, drawn |
//!
//! `precise` keeps the paper's three planes and a reason for what is left out, and replaces the fixed
//! thresholds by what the scan shows. Both make the same kind of [`Reconstruction`].

pub mod neighbours;
pub mod paper;
pub mod parameters;
mod picture;
pub mod precise;
mod reconstruct;
pub mod result;
pub mod slices;
#[cfg(test)]
mod tests;

pub use paper::bitmap::Bitmap;
pub use parameters::Parameters;
pub use parameters::profile::Profile;
pub use parameters::thresholds::Thresholds;
pub(crate) use picture::{COLOURS, Mark, Sketch, WINDOW, draw, grey, marks_of_plane};
pub use picture::{border_picture, legend, picture};
pub use precise::reconstruction::border;
pub use reconstruct::reconstruct;
pub use result::{Contours, Decision, Figures, PipelineError, Reason, Reconstruction, Rejection, SliceRow};

/// The one name of a variant without fields, as it stands in JSON.
pub(crate) fn name_of(variant: &impl serde::Serialize) -> String {
    match serde_json::to_value(variant) {
        Ok(serde_json::Value::String(name)) => name,
        _ => "unknown".to_owned(),
    }
}
