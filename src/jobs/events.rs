//! Who watches a reconstruction hears of it here: one broadcast channel for each reconstruction
//! that has a subscriber. Nothing depends on an event being heard; the catalog is the truth.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde::Serialize;
use tokio::sync::broadcast;

use crate::observer::Stage;
use crate::store::{ReconstructionId, ReconstructionState};

/// Events that a slow subscriber may be behind before it misses the oldest.
const BACKLOG: usize = 64;

/// A reconstruction has changed its state or stage, or got further.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, utoipa::ToSchema)]
pub struct Event {
    /// Which reconstruction.
    pub id: ReconstructionId,
    /// Its state now.
    pub state: ReconstructionState,
    /// What runs now; `null` while it waits and once it has ended.
    pub stage: Option<Stage>,
    /// Part of the whole that is done, 0 to 1: 1 once it has succeeded, 0 if it ended otherwise.
    pub fraction: f64,
}

/// The channels.
#[derive(Debug, Default)]
pub(super) struct Hub {
    channels: Mutex<HashMap<ReconstructionId, broadcast::Sender<Event>>>,
}

impl Hub {
    /// From now on, until the final state.
    pub(super) fn subscribe(&self, id: ReconstructionId) -> broadcast::Receiver<Event> {
        let mut channels = self.channels();
        channels.retain(|_, sender| sender.receiver_count() > 0);
        channels.entry(id).or_insert_with(|| broadcast::channel(BACKLOG).0).subscribe()
    }

    /// Tells the subscribers; after a final state their channel ends.
    pub(super) fn publish(&self, event: Event) {
        let mut channels = self.channels();
        if let Some(sender) = channels.get(&event.id) {
            // Fails only where the last subscriber has just left.
            let _nobody_listens = sender.send(event);
        }
        if event.state.is_final() {
            channels.remove(&event.id);
        }
    }

    /// Ends the subscriptions to a reconstruction that is no more.
    pub(super) fn close(&self, id: ReconstructionId) {
        self.channels().remove(&id);
    }

    fn channels(&self) -> MutexGuard<'_, HashMap<ReconstructionId, broadcast::Sender<Event>>> {
        self.channels.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use tokio::sync::broadcast::error::TryRecvError;

    use super::*;

    fn event(id: ReconstructionId, state: ReconstructionState) -> Event {
        Event { id, state, stage: None, fraction: 0.0 }
    }

    #[test]
    fn a_subscription_ends_after_the_final_state() {
        let (hub, id) = (Hub::default(), ReconstructionId::new());
        let mut events = hub.subscribe(id);
        hub.publish(event(ReconstructionId::new(), ReconstructionState::Failed));
        hub.publish(event(id, ReconstructionState::Running));
        hub.publish(event(id, ReconstructionState::Succeeded));
        assert_eq!(events.try_recv().unwrap().state, ReconstructionState::Running);
        assert_eq!(events.try_recv().unwrap().state, ReconstructionState::Succeeded);
        assert_eq!(events.try_recv().unwrap_err(), TryRecvError::Closed);
    }

    #[test]
    fn channels_that_nobody_hears_are_given_back() {
        let hub = Hub::default();
        for _ in 0..100 {
            drop(hub.subscribe(ReconstructionId::new()));
        }
        assert_eq!(hub.channels().len(), 1);
    }
}
