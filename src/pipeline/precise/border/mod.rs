//! Where the border of the patient crosses the grid lines of the scan, and how exactly that is known.

pub(crate) mod between_slices;
pub(crate) mod candidate;
pub(crate) mod candidates;
pub(crate) mod caps;
pub(crate) mod crossing;
pub(crate) mod crossings;
pub(crate) mod edge_fit;
pub(crate) mod edge_spread;
pub(crate) mod local_levels;
pub(crate) mod plateau;
pub(crate) mod rejected;
pub(crate) mod split;
