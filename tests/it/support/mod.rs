//! What the tests share.

pub(crate) mod data;
pub(crate) mod dimse;
pub(crate) mod entrance;
pub(crate) mod instances;
pub(crate) mod published;
pub(crate) mod scu;
pub(crate) mod slice;
