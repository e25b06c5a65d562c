//! The properties of a place of the border: its evidence, and what became of it.

use crate::geometry::Vec3;
use crate::pipeline::precise::border::crossing::Crossing;
use crate::pipeline::precise::border::rejected::Rejected;
use crate::pipeline::precise::reason::StretchReason;

/// A place of the border.
#[derive(Clone, Copy)]
pub(super) enum Place<'a> {
    /// One that was measured, and that nothing rejects.
    Measured(&'a Crossing),
    /// One that is not accepted.
    Rejected(&'a Rejected),
}

/// A property: its name in the file, what it is, and its value; NaN where it was not measured.
pub(super) struct Column {
    pub(super) name: &'static str,
    pub(super) meaning: &'static str,
    pub(super) value: fn(Place<'_>) -> f64,
}

/// Those of every place, in the order of the file.
pub(super) const ALL: [Column; 14] = [
    Column { name: "x", meaning: "LPS mm", value: |p| place(p)[0] },
    Column { name: "y", meaning: "LPS mm", value: |p| place(p)[1] },
    Column { name: "z", meaning: "LPS mm", value: |p| place(p)[2] },
    Column { name: "nx", meaning: "outward unit normal", value: |p| normal(p)[0] },
    Column { name: "ny", meaning: "outward unit normal", value: |p| normal(p)[1] },
    Column { name: "nz", meaning: "outward unit normal", value: |p| normal(p)[2] },
    Column { name: "axis", meaning: "array axis of the line: 0 z, 1 y, 2 x", value: |p| f64::from(axis(p)) },
    Column {
        name: "planes",
        meaning: "1 axial, 2 sagittal, 4 coronal, added; 0 if rejected",
        value: |p| crossing(p).map_or(0.0, |c| f64::from(c.planes.bits())),
    },
    Column {
        name: "between",
        meaning: "1 if interpolated between two slices",
        value: |p| crossing(p).map_or(0.0, |c| f64::from(u8::from(c.between))),
    },
    Column { name: "error_mm", meaning: "expected error of the edge alone", value: |p| of(p, |c| c.error) },
    Column {
        name: "level_mm",
        meaning: "how far the scan's usual levels would move it",
        value: |p| of(p, |c| c.level),
    },
    Column {
        name: "reason",
        meaning: "0 skin, else why not: 1 foreign, 2 touching, 3 covered, 4 field_of_view, 5 canal, 6 unresolved",
        value: |p| rejected(p).map_or(0.0, |r| code(r.reason)),
    },
    Column {
        name: "measured",
        meaning: "what the rule measured, in the reason's unit",
        value: |p| rejected(p).map_or(f64::NAN, |r| r.measured),
    },
    Column {
        name: "limit",
        meaning: "the rule's limit, in the same unit",
        value: |p| rejected(p).map_or(f64::NAN, |r| r.limit),
    },
];

fn place(p: Place<'_>) -> Vec3 {
    match p {
        Place::Measured(c) => c.place,
        Place::Rejected(r) => r.place,
    }
}

fn normal(p: Place<'_>) -> Vec3 {
    match p {
        Place::Measured(c) => c.normal,
        Place::Rejected(r) => r.normal,
    }
}

fn axis(p: Place<'_>) -> u8 {
    match p {
        Place::Measured(c) => c.axis,
        Place::Rejected(r) => r.axis,
    }
}

fn crossing(p: Place<'_>) -> Option<&Crossing> {
    match p {
        Place::Measured(c) => Some(c),
        Place::Rejected(_) => None,
    }
}

fn rejected(p: Place<'_>) -> Option<&Rejected> {
    match p {
        Place::Measured(_) => None,
        Place::Rejected(r) => Some(r),
    }
}

fn of(p: Place<'_>, value: fn(&Crossing) -> f64) -> f64 {
    crossing(p).map_or(f64::NAN, value)
}

/// The reason's place in [`StretchReason::ALL`], counted from 1.
fn code(reason: StretchReason) -> f64 {
    f64::from(reason as u8 + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_codes_in_the_file_are_those_of_the_reasons() {
        let told = ALL.iter().find(|column| column.name == "reason").expect("a reason").meaning;
        for reason in StretchReason::ALL {
            assert!(told.contains(&format!("{} {}", code(reason), reason.name())), "{reason:?}: {told}");
        }
    }
}
