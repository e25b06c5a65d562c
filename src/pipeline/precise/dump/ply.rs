//! Places with their evidence as PLY, binary and little endian, every property a double.

use std::fmt::Write as _;

use super::columns::{Column, Place};
use crate::pipeline::precise::border::crossing::Crossing;
use crate::pipeline::precise::border::rejected::Rejected;

/// The file: what was measured, then what was rejected; a comment says what each property is.
pub(super) fn encode(columns: &[Column], measured: &[Crossing], rejected: &[Rejected]) -> Vec<u8> {
    let count = measured.len() + rejected.len();
    let mut header = String::from("ply\nformat binary_little_endian 1.0\n");
    for Column { name, meaning, .. } in columns {
        writeln!(header, "comment {name}: {meaning}").expect("a string takes it");
    }
    writeln!(header, "element vertex {count}").expect("a string takes it");
    for Column { name, .. } in columns {
        writeln!(header, "property double {name}").expect("a string takes it");
    }
    header.push_str("end_header\n");
    let mut file = header.into_bytes();
    file.reserve(count * columns.len() * size_of::<f64>());
    let places = measured.iter().map(Place::Measured).chain(rejected.iter().map(Place::Rejected));
    for place in places {
        columns.iter().for_each(|column| file.extend((column.value)(place).to_le_bytes()));
    }
    file
}
