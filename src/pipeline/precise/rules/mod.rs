//! The fourth stage: which of the border is skin, and why another part of it is none. One file a reason
//! ([`StretchReason`]).
//!
//! Most rules judge a place by itself, at the first look at it, before it is measured ([`AT_FIRST_SIGHT`]);
//! `covered` judges the surface that the measured places make.

pub(crate) mod canal;
pub(crate) mod covered;
pub(crate) mod field_of_view;
pub(crate) mod foreign;
pub(crate) mod touching;
pub(crate) mod unresolved;

use super::border::Border;
use super::border::crossing::Crossing;
use super::border::rejected::Rejected;
use super::border::sighting::Rule;
use super::labels::head::Head;
use super::labels::patient::Patient;
use super::reason::StretchReason;
use super::scan::Scan;
use super::scan::edge_spread::EdgeSpread;
use crate::geometry::Vec3;
use crate::observer::Stage;
use crate::observer::stop::Asked;
use covered::Covered;

/// The rules of the first look, in the order in which they are asked.
pub(crate) const AT_FIRST_SIGHT: [Rule; 6] = [
    canal::test,
    unresolved::under_a_layer,
    foreign::test,
    field_of_view::test,
    touching::test,
    unresolved::test,
];

/// The border, judged.
#[derive(Debug)]
pub(crate) struct Verdicts {
    /// Which tissue is the patient, and which a device.
    pub(crate) patient: Patient,
    /// Where the head is, and where it ends.
    pub(crate) head: Head,
    /// Skin, where lines of the scan show it.
    pub(crate) accepted: Vec<Crossing>,
    /// The same with the skin between thick slices; `None` where slices need no help.
    with_between: Option<Vec<Crossing>>,
    /// No skin, each with its reason.
    pub(crate) rejected: Vec<Rejected>,
    /// How wide the scan shows an edge.
    pub(crate) edge_spread: EdgeSpread,
}

impl Verdicts {
    /// Takes out of the border what lies under something.
    pub(crate) fn of(scan: &Scan<'_>, border: Border) -> Self {
        let sampler = &scan.sampler;
        let Border {
            patient,
            head,
            seen: mut accepted,
            mut with_between,
            mut rejected,
            edge_spread,
            slender,
        } = border;
        let of_canals = rejected.iter().filter(|one| one.reason == StretchReason::Canal);
        let canals: Vec<Vec3> = of_canals.map(|one| one.place).collect();
        let near_foreign = |place| patient.is_near_foreign(place);
        let all = with_between.as_ref().unwrap_or(&accepted);
        sampler.ask();
        let covered = Covered::of(scan, all, &canals, slender.as_ref(), near_foreign);
        sampler.ask();
        rejected.extend(covered.take(sampler, &mut accepted));
        if let Some(all) = &mut with_between {
            let mut item = 0;
            all.retain(|crossing| {
                item += 1;
                sampler.ask_at(item);
                !covered.holds(crossing.place)
            });
        }
        scan.tell(Stage::Crossings, 1.0);
        Self { patient, head, accepted, with_between, rejected, edge_spread }
    }

    /// Drops it, asking.
    pub(crate) fn free(self, asked: Asked<'_>) {
        asked.free(self.accepted);
        asked.free(self.with_between.unwrap_or_default());
        asked.free(self.rejected);
    }

    /// All skin, that between thick slices too.
    pub(crate) fn all(&self) -> &[Crossing] {
        self.with_between.as_ref().unwrap_or(&self.accepted)
    }
}
