//! One point for each leaf, the coarse ones first.

pub(crate) mod clouds;
pub(crate) mod leaves;
pub(crate) mod order;
pub(crate) mod point;
