//! The level of the tissue just inside the skin.

use rayon::prelude::*;

use super::candidate::Candidate;
use super::edge_fit::upper_tail;
use super::local_levels::LocalLevels;
use crate::geometry::scale;
use crate::pipeline::precise::scan::edge_spread::EdgeSpread;
use crate::pipeline::precise::scan::sampler::Sampler;

/// Reads the tissue's level again, now that the edge and its width are known: close behind the
/// edge, before the next layer begins, with what the air lends to it taken off.
pub(crate) fn refine_levels(
    sampler: &Sampler,
    edge_spread: &EdgeSpread,
    local: &LocalLevels,
    candidates: &mut [Candidate],
) {
    candidates.par_iter_mut().enumerate().panic_fuse().for_each(|(i, c)| {
        sampler.ask_at(i);
        let air = local.at(i).air;
        let sigma = edge_spread.seen_along(sampler, c.normal);
        // The tissue's share of what is seen at a depth is known; the rest is air.
        let inward = sampler.line(c.place, scale(c.normal, -1.0));
        let level = |depth: f64| {
            let lent = upper_tail(depth / sigma);
            let seen = f64::from(inward.sample(depth)?);
            Some((seen - lent * f64::from(air)) / (1.0 - lent))
        };
        let depths = PLATEAU.map(|(deviations, most)| f64::min(deviations * sigma, most));
        let [Some(first), Some(second)] = depths.map(level) else { return };
        let mut tissue = f64::midpoint(first, second);
        let further = level(depths[1] + FURTHER_MM);
        c.decline = further.map_or(0.0, |further| (tissue - further) as f32);
        // As far as what lies below the skin shows already, it is taken off by what it shows further in.
        let (near, far) = (f64::midpoint(depths[0], depths[1]), depths[1] + FURTHER_MM);
        if let Some(decline) = further.map(|further| tissue - further).filter(|d| DECLINE.contains(d)) {
            let below = |depth: f64| upper_tail((SKIN_MM - depth) / sigma);
            tissue += decline * below(near) / (below(far) - below(near));
        }
        c.tissue = tissue as f32;
    });
}

/// How far behind the edge the tissue's level is read, in standard deviations of the edge, but no
/// further than so many mm: there the fat below the skin begins to show.
const PLATEAU: [(f64, f64); 2] = [(1.4, 0.7), (1.9, 0.85)];
/// So much further in it is read once more, mm.
const FURTHER_MM: f64 = 0.5;
/// Thickness of the skin, mm: that of face and scalp is 1.5 to 2.5.
const SKIN_MM: f64 = 1.8;
/// By how much the level may fall to there for fat to be the cause, HU.
const DECLINE: std::ops::Range<f64> = -60.0..120.0;
