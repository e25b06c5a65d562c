//! What may lie on the skin, by the shape that a look at its mesh shows.

use std::ops::Range;

use crate::pipeline::precise::rules::covered::surface::Surface;

/// The rim of what lies flat is no shorter: the number of nodes on it, of the square root of the
/// number within; a circle's is 2√π.
const LYING: Range<f64> = 3.5..f64::INFINITY;
/// What sticks out is large for its rim.
const STICKING_OUT: Range<f64> = 0.0..3.7;

/// What may be covered, by size and by how much of its rim has to be a ledge.
#[derive(Debug)]
pub(super) struct Kind {
    /// Diagonal of the box around it, mm.
    pub(super) extent_mm: Range<f64>,
    /// Least area, mm²,
    pub(super) area_mm2: f64,
    /// and of the square of the diagonal: a fold of the skin is narrow.
    pub(super) compact: f64,
    /// Least area that faces one way, of the square of the diagonal: lips and noses are round.
    pub(super) flat: f64,
    /// How long its rim is, of the square root of the number of nodes within.
    pub(super) rim: Range<f64>,
    /// Least share of the rim that is a ledge.
    pub(super) ledge: f64,
    /// The same at a rough fill: then the exact one is worth its time.
    pub(super) roughly: f64,
    /// How steeply its rim rises at least, on average, as a sine: eyelids slope.
    pub(super) steep: f64,
    /// What of a head is like it.
    pub(super) like: Like,
}

/// What a head has that is like something on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Like {
    Nothing,
    /// That stands off the head.
    Ear,
    /// That lies before an ear canal; and the wings of a nose, and lips.
    Tragus,
}

impl Kind {
    /// Whether nodes with a box of diagonal `extent` mm around them are as large as this kind.
    pub(super) fn has_size(&self, surface: &Surface, nodes: &[usize], extent: f64) -> bool {
        let least = self.area_mm2.max(self.compact * extent * extent);
        self.extent_mm.contains(&extent) && nodes.len() >= surface.nodes_of(least)
    }
}

/// How closely the skin is looked at.
#[derive(Debug)]
pub(crate) struct Look {
    /// Edge of the mesh's leaves, mm.
    pub(crate) leaf_mm: f64,
    /// What is covered reaches so many links beyond its rim: the ledge itself.
    pub(crate) beyond: usize,
    pub(super) kinds: &'static [Kind],
    /// Whether a patient who moves between slices shows.
    pub(super) shows_motion: bool,
}

/// To see what is thin.
pub(crate) const CLOSELY: Look = Look { leaf_mm: 1.0, beyond: 2, kinds: &THIN, shows_motion: true };
/// To see what is thick.
pub(crate) const COARSELY: Look = Look { leaf_mm: 2.0, beyond: 1, kinds: &THICK, shows_motion: false };

/// Masks and straps are larger than ears, noses and lips, fiducials and electrodes smaller. A pad may
/// be as large as these, but is flat; one as large as a chin, from 40 to 57 mm, is not told from it.
pub(super) const THIN: [Kind; 4] = [
    Kind {
        extent_mm: 95.0..f64::INFINITY,
        area_mm2: 2000.0,
        compact: 0.0,
        flat: 0.0,
        rim: LYING,
        ledge: 0.65,
        roughly: 0.55,
        steep: 0.0,
        like: Like::Nothing,
    },
    Kind {
        extent_mm: 80.0..95.0,
        area_mm2: 1000.0,
        compact: 0.2,
        flat: 0.0,
        rim: LYING,
        ledge: 0.8,
        roughly: 0.7,
        steep: 0.0,
        like: Like::Ear,
    },
    Kind {
        extent_mm: 57.0..80.0,
        area_mm2: 1000.0,
        compact: 0.2,
        flat: 0.25,
        rim: LYING,
        ledge: 0.8,
        roughly: 0.7,
        steep: 0.0,
        like: Like::Ear,
    },
    Kind {
        extent_mm: 0.0..40.0,
        area_mm2: 60.0,
        compact: 0.3,
        flat: 0.23,
        rim: LYING,
        ledge: 0.85,
        roughly: 0.75,
        steep: 0.47,
        like: Like::Tragus,
    },
];

/// Nothing of a head sticks out like a finger or a tube, from a narrow foot. The wall around a thick
/// pad is a ledge to a coarse look, although it is tall or bevelled. So are the sides of a nose or a
/// neck; but a nose is narrow, and a neck has a ledge on few sides.
const THICK: [Kind; 4] = [
    Kind {
        extent_mm: 20.0..150.0,
        area_mm2: 300.0,
        compact: 0.0,
        flat: 0.0,
        rim: STICKING_OUT,
        ledge: 0.8,
        roughly: 0.7,
        steep: 0.0,
        like: Like::Nothing,
    },
    Kind {
        extent_mm: 57.0..80.0,
        area_mm2: 1000.0,
        compact: 0.58,
        flat: 0.25,
        rim: LYING,
        ledge: 0.7,
        roughly: 0.6,
        steep: 0.0,
        like: Like::Ear,
    },
    THICK_PAD,
    // As large as the largest ears.
    Kind { extent_mm: 80.0..95.0, like: Like::Ear, ..THICK_PAD },
];

const THICK_PAD: Kind = Kind {
    extent_mm: 95.0..f64::INFINITY,
    area_mm2: 3000.0,
    compact: 0.5,
    flat: 0.0,
    rim: LYING,
    ledge: 0.7,
    roughly: 0.6,
    steep: 0.0,
    like: Like::Nothing,
};
