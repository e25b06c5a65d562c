//! What every cell of the scan is: the patient, something else, air outside, a canal.

pub(crate) mod body;
pub(crate) mod canals;
pub(crate) mod crop;
pub(crate) mod devices;
pub(crate) mod field_border;
pub(crate) mod head;
pub(crate) mod label;
pub(crate) mod outside;
pub(crate) mod patient;
