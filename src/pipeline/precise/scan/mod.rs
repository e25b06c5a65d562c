//! The scan as a field in mm: where a voxel is, what the scan shows at a place, its levels and its limits.

pub(crate) mod edge_spread;
pub(crate) mod empty_ends;
pub(crate) mod field_of_view;
pub(crate) mod levels;
pub(crate) mod sampler;
pub(crate) mod survey;
