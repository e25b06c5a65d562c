//! The paper's evaluation (section 3): how a cloud compares to the truth and to the axial cloud.
//!
//! | module | what it does |
//! |---|---|
//! | [`files`] | clouds and meshes of any origin → [`Shape`] |
//! | `mesh` | a triangle mesh: closest points, which side is outside, points spread over it |
//! | [`Target`] | what distances are measured to: a mesh or a cloud |
//! | [`Distances`], [`Coverage`] | without registration |
//! | [`icp`] | the paper's registration, as CloudCompare computes it |
//! | [`evaluate`], [`compare`] | all of it, as a report |
//!
//! Pure and synchronous; LPS mm throughout. Sums run in the order of the points, so that the same
//! input gives the same figures on any number of threads.

mod compare;
mod coverage;
mod distances;
mod evaluate;
pub mod files;
pub mod icp;
mod mesh;
mod shape;
mod target;
mod unique;

pub use compare::{Comparison, Direction, compare};
pub use coverage::Coverage;
pub use distances::Distances;
pub use evaluate::{Empty, Evaluation, OverAxial, evaluate};
pub use shape::{Kind, Shape};
pub use target::{Sign, Target};
pub use unique::Unique;
