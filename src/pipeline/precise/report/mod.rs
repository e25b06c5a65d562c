//! What a user is told: the quality of the result, and the stretches of every slice.

pub(crate) mod assess;
pub(crate) mod border;
pub(crate) mod quality;
pub(crate) mod sides;
pub(crate) mod stretches;
