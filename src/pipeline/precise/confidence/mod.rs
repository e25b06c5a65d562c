//! How far a point can be trusted, in mm.

pub(crate) mod agreement;
pub(crate) mod error;
pub(crate) mod motion;
