//! What of the border is no skin: one file a reason.

pub(crate) mod covered;
