//! Levels of tissue and air by region: what one line shows of them is scattered by noise, what
//! its neighbourhood shows is not.

use std::collections::HashMap;

use super::candidates::Candidate;
use super::levels::Levels;

/// Edge of a region, mm.
const EDGE_MM: f64 = 5.0;
/// Tissue at the skin is never taken for more or less than this, relative to soft tissue, HU.
const TISSUE: [f32; 2] = [-180.0, 80.0];
/// Air at the skin (foam, cloth and hair lift it) relative to air, HU.
const AIR: [f32; 2] = [-30.0, 200.0];

/// The levels at every candidate.
#[derive(Debug)]
pub(super) struct Regions {
    levels: Vec<(f32, f32)>,
    of: Vec<u32>,
}

impl Regions {
    /// Medians over the candidates of each region.
    pub(super) fn of(candidates: &[Candidate], levels: &Levels) -> Self {
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
                let lowest = if levels.clipped.is_some() { 0.0 } else { AIR[0] };
                (
                    tissue.clamp(levels.tissue + TISSUE[0], levels.tissue + TISSUE[1]),
                    air.clamp(levels.air + lowest, levels.air + AIR[1]),
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
