//! The head: its outer surface, what is inside, and how it is held.

mod blend;
mod head;
mod pose;
mod tissue;

pub(super) use head::Head;
pub(super) use pose::Pose;
pub(super) use tissue::{AIR, SKIN_DEPTH};
