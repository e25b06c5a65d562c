//! The scan as DICOM files: single-frame CT (PS3.3 A.3) and Enhanced CT (A.38), explicit VR little
//! endian.

mod attributes;
mod layout;
mod multi_frame;
mod single_frame;

use ndarray::Array3;

use super::{Options, Order, uids};
use crate::dicom::Volume;
use crate::geometry::Grid;

pub(super) use multi_frame::multi_frame;
pub(super) use single_frame::single_frames;

/// Values are stored as HU + 1024.
const INTERCEPT: i16 = -1024;

/// The volume that the files hold.
pub(super) fn volume(options: &Options, grid: Grid, hu: Array3<i16>) -> Volume {
    let slices = grid.slice_origins().len();
    let sop_instance_uids = (0..slices).map(|index| uids::single_frame(options, index)).collect();
    Volume { hu, grid, sop_instance_uids, doubtful_slices: Vec::new(), identity: uids::identity(options) }
}

/// Indices along the axis of acquisition, in the order of instance numbers: index 0 is superior,
/// posterior or right.
fn in_order(options: &Options, slices: usize) -> Vec<usize> {
    let along_the_index = match (options.acquisition.plane, options.acquisition.order) {
        (crate::geometry::Plane::Sagittal, order) => order == Order::Ascending,
        (_, order) => order == Order::Descending,
    };
    if along_the_index { (0..slices).collect() } else { (0..slices).rev().collect() }
}
