//! Levels of tissue and air by region: what one line shows of them is scattered by noise, what
//! its neighbourhood shows is not.

use std::collections::HashMap;

use super::candidates::Candidate;
use super::levels::Levels;
use super::width::Width;

/// Edge of a region, mm.
const EDGE_MM: f64 = 5.0;
/// Tissue at the skin is never taken for more or less than this, relative to soft tissue, HU.
const TISSUE: [f32; 2] = [-180.0, 80.0];
/// Nor air for less.
const LEAST_AIR: f32 = -30.0;
/// What lies on the skin, such as foam, cloth and hair, lifts the air to no more than this, HU:
/// where an edge is so wide that what looks like it may be the edge,
pub(super) const MOST_AIR_OF_WIDE: f32 = 200.0;
/// and where it is not.
const MOST_AIR: f32 = 450.0;
/// Widest edge, as a standard deviation, that is over where the air is looked at, mm.
const WIDE_MM: f64 = 0.9;

/// The levels at every candidate.
#[derive(Debug)]
pub(super) struct Regions {
    levels: Vec<(f32, f32)>,
    of: Vec<u32>,
}

/// The highest level that air at the skin is taken for, relative to air, HU.
pub(super) fn most_air(width: &Width) -> f32 {
    if width.in_plane().max(width.across()) < WIDE_MM { MOST_AIR } else { MOST_AIR_OF_WIDE }
}

impl Regions {
    /// Medians over the candidates of each region; air is never taken for more than `most_air`
    /// relative to air, HU.
    pub(super) fn of(candidates: &[Candidate], levels: &Levels, most_air: f32) -> Self {
        let mut names: HashMap<[i32; 3], u32> = HashMap::new();
        let mut members: Vec<Vec<(f32, f32)>> = Vec::new();
        let of = candidates
            .iter()
            .map(|c| {
                let key = c.place.map(|v| (v / EDGE_MM).floor() as i32);
                let name = *names.entry(key).or_insert_with(|| {
                    members.push(Vec::new());
                    members.len() as u32 - 1
                });
                members[name as usize].push((c.tissue, c.air));
                name
            })
            .collect();
        let levels = members
            .iter()
            .map(|m| {
                let tissue = median(m.iter().map(|v| v.0));
                let air = median(m.iter().map(|v| v.1));
                let lowest = if levels.clipped.is_some() { 0.0 } else { LEAST_AIR };
                (
                    tissue.clamp(levels.tissue + TISSUE[0], levels.tissue + TISSUE[1]),
                    air.clamp(levels.air + lowest, levels.air + most_air),
                )
            })
            .collect();
        Self { levels, of }
    }

    /// Tissue and air at a candidate, HU.
    #[inline]
    pub(super) fn levels(&self, candidate: usize) -> (f32, f32) {
        self.levels[self.of[candidate] as usize]
    }
}

/// The middle one of some values, at least one.
pub(super) fn median(values: impl Iterator<Item = f32>) -> f32 {
    let mut values: Vec<f32> = values.collect();
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}
