//! What is known of the senders of this process while they are open: in which order they began and
//! broke off, and which of their instances lack.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::{Mutex, MutexGuard, PoisonError};

use uuid::Uuid;

use crate::dicom::uid::{SeriesInstanceUid, SopInstanceUid};
use crate::store::{SenderEnd, SenderEnded};

/// See the module.
#[derive(Debug, Default)]
pub(super) struct Senders(Mutex<State>);

#[derive(Debug, Default)]
struct State {
    /// Counts begins and breaks: a clock can be set back.
    moment: i64,
    open: HashMap<Uuid, Open>,
}

#[derive(Debug, Default)]
struct Open {
    begun: i64,
    broke: Option<i64>,
    cut: BTreeSet<SopInstanceUid>,
    /// The series of those whose beginning told it.
    series: BTreeMap<SopInstanceUid, SeriesInstanceUid>,
    has_unnamed: bool,
}

impl State {
    fn next(&mut self) -> i64 {
        self.moment += 1;
        self.moment
    }

    /// The sender, which begins now if it is not known.
    fn of(&mut self, sender: Uuid) -> &mut Open {
        let next = self.moment + 1;
        let open = self.open.entry(sender).or_insert_with(|| Open { begun: next, ..Open::default() });
        self.moment = self.moment.max(open.begun);
        open
    }
}

impl Senders {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// When the sender began; now, if it is not known.
    pub(super) fn begun(&self, sender: Uuid) -> i64 {
        self.state().of(sender).begun
    }

    /// The sender breaks off now, whenever that is recorded.
    pub(super) fn breaks(&self, sender: Uuid) {
        let mut state = self.state();
        let now = state.next();
        state.of(sender).broke.get_or_insert(now);
    }

    /// An instance of the sender lacks; `None`: it can't be told which.
    pub(super) fn lacks(&self, sender: Uuid, instance: Option<SopInstanceUid>) {
        let mut state = self.state();
        let open = state.of(sender);
        match instance {
            Some(instance) => drop(open.cut.insert(instance)),
            None => open.has_unnamed = true,
        }
    }

    /// An instance of the sender was cut, of that series if its beginning told it.
    pub(super) fn cut(&self, sender: Uuid, instance: SopInstanceUid, series: Option<SeriesInstanceUid>) {
        let mut state = self.state();
        let open = state.of(sender);
        if let Some(series) = series {
            open.series.insert(instance.clone(), series);
        }
        open.cut.insert(instance);
    }

    /// It came again, and is stored.
    pub(super) fn brought(&self, sender: Uuid, instance: &SopInstanceUid) {
        if let Some(open) = self.state().open.get_mut(&sender) {
            open.cut.remove(instance);
            open.series.remove(instance);
        }
    }

    /// The sender ended in that way: it did not end well if instances of it lack.
    pub(super) fn ended(&self, sender: Uuid, end: SenderEnd) -> SenderEnded {
        let mut state = self.state();
        let now = state.next();
        let Open { broke, cut, series, has_unnamed, .. } = state.open.remove(&sender).unwrap_or_default();
        let lacks = has_unnamed || !cut.is_empty();
        let end = if lacks && end.completes().is_some() { SenderEnd::InstancesRefused } else { end };
        SenderEnded {
            end,
            at: broke.unwrap_or(now),
            cut: cut.into_iter().collect(),
            of_series: series.into_iter().collect(),
            has_unnamed,
        }
    }

    /// Whether instances of the sender lack.
    pub(super) fn is_short(&self, sender: Uuid) -> bool {
        self.state().open.get(&sender).is_some_and(|open| open.has_unnamed || !open.cut.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_break_is_when_it_was_noticed_and_what_lacks_is_no_good_end() {
        let senders = Senders::default();
        let (one, two, three) = (Uuid::new_v4(), Uuid::new_v4(), Uuid::new_v4());
        let begun = senders.begun(one);
        assert_eq!(senders.begun(one), begun);
        senders.breaks(one);
        assert!(senders.begun(two) > begun);
        let ended = senders.ended(one, SenderEnd::AssociationLost);
        assert!(begun < ended.at && ended.at < senders.begun(two), "{ended:?}");
        let instance: SopInstanceUid = "1.2".parse().unwrap();
        senders.lacks(two, Some(instance.clone()));
        senders.brought(two, &instance);
        senders.lacks(three, Some(instance.clone()));
        assert_eq!(senders.ended(two, SenderEnd::AssociationReleased).end, SenderEnd::AssociationReleased);
        let ended = senders.ended(three, SenderEnd::UploadEnded);
        assert_eq!((ended.end, ended.cut), (SenderEnd::InstancesRefused, vec![instance]));
        assert!(senders.state().open.is_empty());
    }
}
