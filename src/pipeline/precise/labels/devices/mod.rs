//! What lies beside the patient or hangs on it.

pub(crate) mod cords;
pub(crate) mod couch;
pub(crate) mod large;
pub(crate) mod parts;
pub(crate) mod sheets;
