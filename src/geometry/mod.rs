//! Where a voxel is in the patient: planes, frames and the grid of a [`crate::dicom::Volume`].
//!
//! All coordinates are DICOM patient coordinates in mm (PS3.3 C.7.6.2.1.1): x to the patient's
//! left, y to the posterior, z to the head (LPS), unless a [`Frame`] says otherwise.

mod eigen;
mod frame;
mod grid;
mod plane;
mod vector;

pub(crate) use eigen::{eigenvalues, leading_eigenvector, smallest_eigenvector};
pub use frame::Frame;
pub use grid::{Axis, Grid};
pub use plane::{Plane, PlaneSet};
pub use vector::{Vec3, add, cross, dot, norm, normalised, scale, sub};
