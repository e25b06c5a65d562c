//! Geometry that knows no anatomy: cells along the patient's axes, what hangs together of them, what lies
//! within reach, rays, leaves.

pub(crate) mod bit_rows;
pub(crate) mod cells;
pub(crate) mod cubes;
pub(crate) mod index;
pub(crate) mod pieces;
pub(crate) mod rays;
pub(crate) mod reach;
