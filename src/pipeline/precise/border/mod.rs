//! The third stage: where the border of the patient crosses the grid lines of the scan, and how exactly that
//! is known.

pub(crate) mod between_slices;
pub(crate) mod candidate;
pub(crate) mod candidates;
pub(crate) mod caps;
pub(crate) mod crossing;
pub(crate) mod crossings;
pub(crate) mod edge_fit;
pub(crate) mod edge_spread;
pub(crate) mod local_levels;
pub(crate) mod plateau;
pub(crate) mod rejected;
pub(crate) mod sighting;
pub(crate) mod split;

use super::labels::Labels;
use super::labels::head::Head;
use super::labels::patient::Patient;
use super::labels::slender::Slender;
use super::no_skin::NoSkin;
use super::scan::Scan;
use super::scan::edge_spread::EdgeSpread;
use crate::observer::Stage;
use between_slices::BetweenSlices;
use crossing::Crossing;
use local_levels::{LocalLevels, MOST_AIR_OF_WIDE, most_air};
use rejected::Rejected;
use sighting::Rule;

/// The border of the patient, measured.
#[derive(Debug)]
pub(crate) struct Border {
    /// Which tissue is the patient, and which a device.
    pub(crate) patient: Patient,
    /// Where the head is, and where it ends.
    pub(crate) head: Head,
    /// What lines of the scan show.
    pub(crate) seen: Vec<Crossing>,
    /// The same with what was interpolated between thick slices; `None` where slices need no help.
    pub(crate) with_between: Option<Vec<Crossing>>,
    /// What a rule rejected at the first look, and what could not be measured.
    pub(crate) rejected: Vec<Rejected>,
    /// How wide the scan shows an edge.
    pub(crate) edge_spread: EdgeSpread,
    /// See [`Labels::slender`].
    pub(crate) slender: Option<Slender>,
}

impl Border {
    /// Finds the border, and measures what no rule of the first look rejects.
    ///
    /// # Errors
    /// [`NoSkin::NoBorder`].
    pub(crate) fn of(scan: &Scan<'_>, labels: Labels, rules: &[Rule]) -> Result<Self, NoSkin> {
        let Scan { sampler, levels, .. } = scan;
        let asked = sampler.asked();
        let (mut candidates, mut rejected) = candidates::find(scan, &labels, rules);
        // Nobody asks for the air any more, and it is large.
        let Labels { patient, head, slender, .. } = labels;
        if candidates.is_empty() {
            return Err(NoSkin::NoBorder);
        }
        scan.tell(Stage::Crossings, 0.4);
        let rough = LocalLevels::of(asked, &candidates, levels, MOST_AIR_OF_WIDE);
        sampler.ask();
        let edge_spread = edge_spread::measure(sampler, levels, &candidates, &rough);
        sampler.ask();
        plateau::refine_levels(sampler, &edge_spread, &rough, &mut candidates);
        sampler.ask();
        let local = rough.again(asked, &candidates, levels, most_air(&edge_spread));
        sampler.ask();
        let (mut seen, unclear) = crossings::measure(scan, &edge_spread, &local, &candidates);
        asked.free(candidates);
        rejected.extend(unclear);
        sampler.ask();
        let between = BetweenSlices::of(sampler, &seen);
        if let Some(between) = &between {
            rejected.extend(between.settle(sampler, &mut seen));
        }
        sampler.ask();
        let with_between = between.map(|between| between.fill(sampler, &seen));
        Ok(Self { patient, head, seen, with_between, rejected, edge_spread, slender })
    }
}
