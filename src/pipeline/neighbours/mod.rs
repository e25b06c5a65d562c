//! Searches among the points of a cloud, and what they may cost.

pub(crate) mod cells;
pub(crate) mod effort;
pub(crate) mod forest;
pub mod unique;
