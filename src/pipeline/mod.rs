//! The triplanar pipeline, in two profiles. Pure: values in, values out. [`reconstruct()`] runs the
//! profile that the parameters name.
//!
//! `paper` is that of Cvetić et al. 2025 (Bioengineering 12(5), 498: "the paper"), one file a step:
//!
//! | step | file | paper |
//! |---|---|---|
//! | a volume is cut into slices along three planes | [`slices`] | section 2.1 |
//! | tissue is white | [`mask`] | Algorithm 1 |
//! | the head's outermost contour | [`contour`] | section 2.2 |
//! | tests, the first that fails rejects the slice | [`rules`] | section 2.2, Algorithms 2 and 3 |
//! | the decision on every slice | [`decisions`] | section 2.2 |
//! | contour pixels become points in the patient | [`lift`] | Algorithm 4 |
//! | one point per cell | [`voxel_grid`] | section 2.3 |
//! | sparse and stray points are dropped | [`radius_outlier`], [`statistical_outlier`] | section 2.3 |
//! | what the axial cloud alone would not have | [`unique`] | section 3.2 |
//!
//! What the paper leaves open is as in the program that its
//! authors published. Two of that program's ways are not taken: points are in true patient
//! coordinates, and so neither are two of the planes a slice too low nor is the lower part of a
//! volume with thick slices cut off.
//!
//! `precise` keeps the three planes and a reason for what is left out, and replaces the fixed
//! thresholds by what the scan shows: its steps are in [`precise`]. `whole_skin` makes its skin the
//! same kind of [`Reconstruction`].

mod bitmap;
mod cells;
#[cfg(test)]
mod cloud_tests;
pub mod contour;
pub mod decisions;
mod effort;
pub mod lift;
pub mod mask;
mod outcome;
mod paper;
pub mod parameters;
mod picture;
pub mod precise;
pub mod radius_outlier;
mod reconstruct;
mod rejection;
pub mod rules;
pub mod slices;
pub mod statistical_outlier;
#[cfg(test)]
mod tests;
mod thresholds;
pub mod unique;
pub mod voxel_grid;
mod whole_skin;

pub use bitmap::Bitmap;
pub use outcome::{Contours, Decision, Figures, PipelineError, Reconstruction, SliceRow};
pub use parameters::{Parameters, Profile};
pub(crate) use picture::{COLOURS, Mark, Sketch, WINDOW, draw, grey, marks_of_plane};
pub use picture::{border_picture, legend, picture};
pub use reconstruct::reconstruct;
pub use rejection::{Reason, Rejection};
pub use thresholds::Thresholds;
pub use whole_skin::border;

/// The one name of a variant without fields, as it stands in JSON.
pub(crate) fn name_of(variant: &impl serde::Serialize) -> String {
    match serde_json::to_value(variant) {
        Ok(serde_json::Value::String(name)) => name,
        _ => "unknown".to_owned(),
    }
}
