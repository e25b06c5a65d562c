//! Levels of tissue and air by region: what one line shows of them is scattered by noise, what
//! its neighbourhood shows is not.

use rayon::prelude::*;

use super::candidate::Candidate;
use crate::observer::stop::Asked;
use crate::pipeline::precise::grid::cubes::{Cubes, groups};
use crate::pipeline::precise::scan::edge_spread::EdgeSpread;
use crate::pipeline::precise::scan::levels::Levels;

/// Edge of a region, mm.
const EDGE_MM: f64 = 5.0;
/// Tissue at the skin is never taken for more or less than this, relative to soft tissue, HU.
const TISSUE: [f32; 2] = [-180.0, 80.0];
/// Nor air for less.
const LEAST_AIR: f32 = -30.0;
/// What lies on the skin, such as foam, cloth and hair, lifts the air to no more than this, HU:
/// where an edge is so wide that what looks like it may be the edge,
pub(crate) const MOST_AIR_OF_WIDE: f32 = 200.0;
/// and where it is not.
const MOST_AIR: f32 = 450.0;
/// Widest edge, as a standard deviation, that is over where the air is looked at, mm.
const WIDE_MM: f64 = 0.9;

/// The levels on both sides of the skin at one place, HU.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AtSkin {
    /// Of the tissue inside.
    pub(crate) tissue: f32,
    /// Of the air outside.
    pub(crate) air: f32,
}

/// The levels at every candidate.
#[derive(Debug)]
pub(crate) struct LocalLevels {
    /// Those of each region.
    levels: Vec<AtSkin>,
    cubes: Cubes,
}

/// The highest level that air at the skin is taken for, relative to air, HU.
pub(crate) fn most_air(edge_spread: &EdgeSpread) -> f32 {
    if edge_spread.in_plane().max(edge_spread.across()) < WIDE_MM { MOST_AIR } else { MOST_AIR_OF_WIDE }
}

impl LocalLevels {
    /// Medians over the candidates of each region; air is never taken for more than `most_air`
    /// relative to air, HU.
    pub(crate) fn of(asked: Asked<'_>, candidates: &[Candidate], levels: &Levels, most_air: f32) -> Self {
        let cubes = Cubes::of(asked, candidates.par_iter().map(|c| c.place), EDGE_MM);
        Self { levels: Vec::new(), cubes }.again(asked, candidates, levels, most_air)
    }

    /// The same from candidates in the same places whose levels were read again.
    pub(crate) fn again(
        self,
        asked: Asked<'_>,
        candidates: &[Candidate],
        levels: &Levels,
        most_air: f32,
    ) -> Self {
        let regions = groups(asked, self.cubes.sorted());
        let lowest = if levels.clipped.is_some() { 0.0 } else { LEAST_AIR };
        let of_region = |members: &&[(u64, u32)]| {
            asked.ask();
            let candidates = || members.iter().map(|m| &candidates[m.1 as usize]);
            let tissue = median(asked, candidates().map(|c| c.tissue));
            let air = median(asked, candidates().map(|c| c.air));
            AtSkin {
                tissue: tissue.clamp(levels.tissue + TISSUE[0], levels.tissue + TISSUE[1]),
                air: air.clamp(levels.air + lowest, levels.air + most_air),
            }
        };
        Self { levels: regions.par_iter().panic_fuse().map(of_region).collect(), ..self }
    }

    /// Those at a candidate.
    #[inline]
    pub(crate) fn at(&self, candidate: usize) -> AtSkin {
        self.levels[self.cubes.cube(candidate)]
    }
}

/// The middle one of some values, at least one.
pub(crate) fn median(asked: Asked<'_>, values: impl Iterator<Item = f32>) -> f32 {
    let mut steps = 0;
    let mut ask = || {
        steps += 1;
        asked.ask_at(steps);
    };
    let mut values: Vec<f32> = values.inspect(|_| ask()).collect();
    let middle = values.len() / 2;
    let compared = |a: &f32, b: &f32| {
        ask();
        a.total_cmp(b)
    };
    *values.select_nth_unstable_by(middle, compared).1
}
